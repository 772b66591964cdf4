"""Which phase the robot is in, which points carry load in it, and what the target is then.

The phases of a motion follow each other by time alone, as in the thesis (chapter 4): take-off and flight as planned,
landing from the planned touchdown until the robot has come to rest, then standing. Lying down and standing up are told.
If asked for, contacts that are felt end the flight instead: half of the points, from its apex on.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum

import numpy as np

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.kinematics import Configuration
from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Plan
from aerial_wbic.gains import ControllerGains, Touchdown
from aerial_wbic.target import Fold, Following, Hold, PostureTarget, WholeBodyTarget


class Phase(IntEnum):
    """What the controller is doing; the numbers are those of ``ControllerStatus``."""

    LIE = 0  # on its way to the ground or on it; joints damped in the end
    STAND = 1  # balanced on all contact points; takes plans
    TAKE_OFF = 2  # on the ground, following a plan
    FLIGHT = 3  # no contact planned
    LANDING = 4  # touched down or getting up, coming to rest
    STOPPED = 5  # emergency stop, until reset


FOLLOWING = (Phase.TAKE_OFF, Phase.FLIGHT)  # a plan gives the target
_INSTANT = 1e-6  # [s] clock and plan are sums of steps: times that are meant to be equal differ by rounding


class Phases:
    """The order of events: it stands first, then does what it is told.

    Args:
        robot: the robot.
        gains: of its controller.
        com_height: of the centre of mass above the ground to stand at until a plan says otherwise [m].
    """

    def __init__(self, robot: Robot, gains: ControllerGains, com_height: float) -> None:
        self.phase = Phase.STAND
        self.plan: Plan | None = None  # the one that runs, in W
        self._robot = robot
        self._gains = gains
        self._com_height = com_height
        self._felt = np.zeros(robot.n_contacts, dtype=bool)  # contacts in the last tick
        self._upright_min = np.cos(gains.fall_tilt)  # vertical part of the base's z axis
        self._foot_radius = float(np.mean([point.radius for point in robot.contact_points]))
        self._all_points = np.ones(robot.n_contacts, dtype=bool)
        self._no_point = np.zeros(robot.n_contacts, dtype=bool)
        self._time = 0.0
        self._plan_begin: float | None = None  # [s]
        self._following: Following | None = None  # of the plan that runs
        self._way: Hold | Fold | None = None  # to rest; None: a plan is followed or joints are damped
        self._next_way: Callable[[Configuration], Hold | Fold] | None = self._to_stance  # from the next tick on

    @property
    def time_in_plan(self) -> float:
        """Time since the plan that runs began [s]; 0 when none does."""
        return 0.0 if self._plan_begin is None else self._time - self._plan_begin

    @property
    def _plan_time(self) -> float:
        """The same, such that a phase that should begin with this tick does."""
        return self.time_in_plan + _INSTANT

    @property
    def settled(self) -> bool:
        """Whether nothing is under way: it stands, lies, or is stopped."""
        if self.phase is Phase.LIE:
            return self._way is None and self._next_way is None
        return self.phase in (Phase.STAND, Phase.STOPPED)

    # --- what it is told ---------------------------------------------------------------------------------------------

    def follow(self, plan: Plan) -> None:
        """Follow ``plan``, expressed in W, from the next tick on."""
        self.plan, self._plan_begin = plan, None
        self._following = Following(plan.track, self._gains.follow)
        self.phase = Phase.TAKE_OFF

    def abort(self) -> None:
        """Call off a motion of which every contact point is still on the ground; come to rest instead.

        Raises:
            RefusalError: if there is nothing to call off, or it is too late.
        """
        if self.phase is not Phase.TAKE_OFF:
            raise RefusalError(RefusalCode.INVALID_REQUEST, f"nothing to abort on the ground: {self._doing()}")
        if not self.contacts().all():
            raise RefusalError(RefusalCode.BUSY, "too late to abort: a foot has left the ground")
        self._end_plan()
        self.phase, self._next_way = Phase.LANDING, self._to_stance

    def lie_down(self) -> None:
        """Sink to the ground and let the joints go.

        Raises:
            RefusalError: if it does not stand.
        """
        if self.phase is not Phase.STAND:
            raise RefusalError(RefusalCode.NOT_STANDING, f"to lie down it must stand: {self._doing()}")
        self.phase, self._next_way = Phase.LIE, self._to_ground

    def stand_up(self) -> None:
        """Fold the legs under the body and rise.

        Raises:
            RefusalError: if it does not lie.
        """
        if self.phase is not Phase.LIE or not self.settled:
            raise RefusalError(RefusalCode.INVALID_REQUEST, f"to stand up it must lie: {self._doing()}")
        self._next_way = self._to_folded

    def stop(self) -> None:
        """Stop until reset: joints are only damped from the next tick on."""
        self._let_go(Phase.STOPPED)

    # --- what happens by itself --------------------------------------------------------------------------------------

    def tick(self, time: float) -> None:
        """Let it be ``time`` [s]; a plan that was accepted begins now, one that runs goes on to its next phase."""
        self._time = time
        if self.phase not in FOLLOWING:
            return
        if self._plan_begin is None:
            self._plan_begin = time
        if self._lands():
            self._com_height = self.plan.landing_com_height
            self.phase, self._next_way = Phase.LANDING, self._to_stance
        elif self._plan_time >= self.plan.take_off_time:
            self.phase = Phase.FLIGHT

    def feel(self, touching: np.ndarray) -> None:
        """Take note of the points that are felt to bear load ``(n_c,)`` bool."""
        self._felt = touching

    def _lands(self) -> bool:
        """Return whether the flight that the plan has is over."""
        plan, time = self.plan, self._plan_time
        if self._gains.touchdown is Touchdown.TIME:
            return time >= plan.landing_time
        down = 2 * self._felt.sum() >= len(self._felt)
        falling = time >= (plan.take_off_time + plan.landing_time) / 2
        return (falling and down) or time >= plan.landing_time + self._gains.touchdown_sensing.patience

    def contacts(self) -> np.ndarray:
        """Return the points that carry load now, by the schedule ``(n_c,)`` bool."""
        if self.phase is Phase.TAKE_OFF:
            return self.plan.track.contact[self.plan.interval(self._plan_time)]
        return self._no_point if self.phase is Phase.FLIGHT else self._all_points

    def target(self, state: Configuration) -> WholeBodyTarget | PostureTarget | None:
        """Return what to do now, seen where the robot is; None: nothing but to damp the joints."""
        if self.phase in FOLLOWING:
            landing, time = self.plan.landing_time, self._plan_time
            return self._following.at(min(time, landing), waiting=time > landing + _INSTANT)
        if self._next_way is not None:
            self._way, self._next_way = self._next_way(state), None
        if isinstance(self._way, Hold) and state.R_WB[2, 2] < self._upright_min:
            self._let_go(Phase.LIE)
        if self._way is None:
            return None
        if self._time >= self._way.end:
            self._arrive(state)
        return None if self._way is None else self._way.at(self._time, state)

    def _arrive(self, state: Configuration) -> None:
        """Go on to what follows the way that is at its end."""
        if self.phase is Phase.LANDING and self._way.reached(state):
            self.phase = Phase.STAND
            self._end_plan()
        elif self.phase is Phase.LANDING:
            self._let_go(Phase.LIE)
        elif self.phase is Phase.LIE and isinstance(self._way, Fold):
            self.phase, self._way = Phase.LANDING, self._to_stance(state)
        elif self.phase is Phase.LIE:
            self._let_go(Phase.LIE)

    def _let_go(self, phase: Phase) -> None:
        self.phase = phase
        self._way = self._next_way = None
        self._end_plan()

    def _end_plan(self) -> None:
        self.plan = self._plan_begin = None

    def _doing(self) -> str:
        return f"the phase is {self.phase.name}"

    # --- ways to rest ------------------------------------------------------------------------------------------------

    def _to_stance(self, state: Configuration) -> Hold:
        return self._hold(state, self._com_height, self._gains.settling_rate)

    def _to_ground(self, state: Configuration) -> Hold:
        return self._hold(state, self._gains.lying_height, self._gains.lying_rate)

    def _hold(self, state: Configuration, com_height: float, rate: float) -> Hold:
        return Hold(
            state,
            self._time,
            rate=rate,
            com_height=com_height - self._foot_radius,
            depth=self._gains.landing_depth,
            turn=self._gains.landing_turn,
            pose=self._robot.poses["home"],
            gains=self._gains.hold,
        )

    def _to_folded(self, state: Configuration) -> Fold:
        return Fold(state, self._time, rate=self._gains.lying_rate, pose=self._robot.poses["tuck"])
