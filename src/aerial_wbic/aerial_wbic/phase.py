"""Which phase the robot is in, which points carry load in it, and what the target is then.

Phases follow each other by time alone, as in the thesis (chapter 4): take-off and flight as planned, landing from the
planned touchdown until the robot has come to rest, then standing.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from aerial_model import rotation
from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.kinematics import Configuration
from aerial_model.plan import Plan
from aerial_model.robot import Robot
from aerial_wbic.gains import ControllerGains
from aerial_wbic.target import Hold, WholeBodyTarget, from_plan


class Phase(IntEnum):
    """What the controller is doing; the numbers are those of ``ControllerStatus``."""

    LIE = 0  # on the ground, joints damped
    STAND = 1  # balanced on all contact points; takes plans
    TAKE_OFF = 2  # on the ground, following a plan
    FLIGHT = 3  # no contact planned
    LANDING = 4  # touched down, coming to rest
    STOPPED = 5  # emergency stop, until reset


FOLLOWING = (Phase.TAKE_OFF, Phase.FLIGHT)  # a plan gives the target
HOLDING = (Phase.LANDING, Phase.STAND)  # rest over the support is the target
DAMPED = (Phase.LIE, Phase.STOPPED)  # there is no target


class Phases:
    """The order of events: stands first, then whatever it is told.

    Args:
        robot: the robot.
        gains: of its controller.
        com_height: of the centre of mass above the ground to stand at until a plan says otherwise [m].
    """

    def __init__(self, robot: Robot, gains: ControllerGains, com_height: float) -> None:
        self.phase = Phase.STAND
        self.plan: Plan | None = None  # the one that runs, in W
        self._gains = gains
        self._com_height = com_height
        self._foot_radius = float(np.mean([point.radius for point in robot.contact_points]))
        self._all_points = np.ones(robot.n_contacts, dtype=bool)
        self._no_point = np.zeros(robot.n_contacts, dtype=bool)
        self._begin: float | None = None  # of the plan [s]
        self._hold: Hold | None = None
        self._time = 0.0

    @property
    def time_in_plan(self) -> float:
        """Time since the plan that runs began [s]; 0 when none does."""
        return 0.0 if self._begin is None else self._time - self._begin

    def follow(self, plan: Plan) -> None:
        """Follow ``plan``, expressed in W, from the next tick on."""
        self.plan, self._begin = plan, None
        self.phase = Phase.TAKE_OFF

    def abort(self) -> None:
        """Call off a motion of which every contact point is still on the ground; come to rest instead.

        Raises:
            RefusalError: if there is nothing to call off, or it is too late.
        """
        if self.phase is not Phase.TAKE_OFF:
            raise RefusalError(RefusalCode.NOT_STANDING, f"nothing to abort on the ground: the phase is {self.phase.name}")
        if not self.contacts().all():
            raise RefusalError(RefusalCode.BUSY, "too late to abort: a foot has left the ground")
        self._end_plan()
        self.phase, self._hold = Phase.STAND, None

    def stop(self) -> None:
        """Stop until reset: joints are only damped from the next tick on."""
        self.phase = Phase.STOPPED
        self._end_plan()

    def tick(self, time: float) -> None:
        """Let it be ``time`` [s]; a plan that was accepted begins now, one that runs goes on to its next phase."""
        self._time = time
        if self.phase not in FOLLOWING:
            return
        if self._begin is None:
            self._begin = time
        if self.time_in_plan >= self.plan.landing_time:
            self.phase = Phase.LANDING
            self._com_height = self.plan.landing_com_height
            self._hold = None
        elif self.time_in_plan >= self.plan.take_off_time:
            self.phase = Phase.FLIGHT

    def contacts(self) -> np.ndarray:
        """Return the points that carry load now, by the schedule ``(n_c,)`` bool."""
        if self.phase is Phase.TAKE_OFF:
            return self.plan.sample(self.time_in_plan).contact
        return self._no_point if self.phase is Phase.FLIGHT else self._all_points

    def judge(self, state: Configuration) -> Phase:
        """Return the phase, seen where the robot is: one that fell lies, one that came to rest stands."""
        if self.phase in HOLDING:
            if rotation.tilt(state.base_orientation) > self._gains.fall_tilt:
                self.phase = Phase.LIE
                self._end_plan()
            elif self._hold is None:
                self._hold = self._begin_hold(state)
            elif self.phase is Phase.LANDING and self._time >= self._hold.end + self._gains.settle_duration:
                self.phase = Phase.STAND
                self._end_plan()
        return self.phase

    def target(self, state: Configuration) -> WholeBodyTarget:
        """Return what to do now, in a phase that has a target."""
        if self.phase in FOLLOWING:
            return from_plan(self.plan.sample(self.time_in_plan), self._gains.follow)
        return self._hold.at(self._time, state)

    def _begin_hold(self, state: Configuration) -> Hold:
        gains = self._gains
        return Hold(
            state,
            self._time,
            rate=gains.settling_rate,
            com_height=self._com_height - self._foot_radius,
            depth=gains.landing_depth,
            gains=gains.hold,
        )

    def _end_plan(self) -> None:
        self.plan = self._begin = None
