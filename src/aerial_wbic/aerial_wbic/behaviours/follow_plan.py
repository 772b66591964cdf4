"""To follow a plan from its start to its touchdown: take-off and flight.

Its phases follow each other by time alone, as in the thesis (chapter 4): take-off and flight as planned, until the planned
touchdown. If asked for, contacts that are felt end the flight instead: half of the points, from its apex on.
"""

from __future__ import annotations

import numpy as np

from aerial_model.kinematics import Configuration
from aerial_model.numerics.components import matrix_of, quaternion, vector
from aerial_model.numerics.jit import compiled
from aerial_model.robot.robot import BASE_ANGULAR, BASE_ORIENTATION, JOINT_POSITION, JOINT_VELOCITY
from aerial_model.values.plan import Track, sampled
from aerial_wbic.behaviours.behaviour import Behaviour, Entry, Event, PlanRun, Setting
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.gains import BodyGains, Touchdown
from aerial_wbic.target import WholeBodyTarget, blank_target, target_in

_INSTANT = 1e-6  # [s] clock and plan are sums of steps: times that are meant to be equal differ by rounding


class FollowPlan(Behaviour):
    """Follows the plan that was accepted, expressed in W, until it has touched down."""

    name = "follow plan"

    def __init__(self, setting: Setting, entry: Entry) -> None:
        super().__init__(setting, entry)
        if entry.plan is None:
            raise ValueError("to follow a plan takes one: the entry has none")
        self.plan_run = self._run = PlanRun(entry.plan)
        self._plan = entry.plan
        self._target = PlanTarget(entry.plan.track, setting.gains.follow)

    def begin(self, time: float) -> None:
        """Set the plan's time 0 to ``time`` [s]."""
        self._run.begin = time

    def phase(self, time: float) -> Phase:
        """Return TAKE_OFF until the planned end of the last contact, then FLIGHT."""
        return Phase.TAKE_OFF if self._plan_time(time) < self._plan.take_off_time else Phase.FLIGHT

    def contact(self, time: float) -> np.ndarray:
        """Return the planned contacts ``(n_c,)`` bool."""
        if self.phase(time) is Phase.FLIGHT:
            return self._setting.no_point
        contact: np.ndarray = self._plan.track.contact[self._plan.interval(self._plan_time(time))]
        return contact

    def scheduled(self, time: float, touching: np.ndarray) -> Event | None:
        """Return TOUCHDOWN when the flight that the plan has is over."""
        plan, gains, now = self._plan, self._setting.gains, self._plan_time(time)
        if gains.touchdown is Touchdown.TIME:
            return Event.TOUCHDOWN if now >= plan.landing_time else None
        down = 2 * touching.sum() >= len(touching)
        falling = now >= (plan.take_off_time + plan.landing_time) / 2
        over = (falling and down) or now >= plan.landing_time + gains.touchdown_sensing.patience
        return Event.TOUCHDOWN if over else None

    def target(self, time: float, state: Configuration) -> WholeBodyTarget:
        """Return the plan's sample, made whole; who waits for a contact keeps the joints of the landing pose still."""
        landing, now = self._plan.landing_time, self._plan_time(time)
        return self._target.at(min(now, landing), waiting=now > landing + _INSTANT)

    def _plan_time(self, time: float) -> float:
        """Return the time in the plan [s] such that a phase that should begin with this tick does."""
        return self._run.time(time) + _INSTANT


class PlanTarget:
    """Makes targets of a plan's samples.

    Args:
        track: of the plan, in W.
        gains: of the base task.
    """

    def __init__(self, track: Track, gains: BodyGains) -> None:
        self._track = track
        self._target = blank_target(track.n_joints, track.contact.shape[1], gains)

    def at(self, time: float, *, waiting: bool = False) -> WholeBodyTarget:
        """Return the target at ``time`` [s] since the plan began; it holds until the next.

        Args:
            time: since the plan began [s].
            waiting: for a contact, in the landing pose: the joints are at rest.
        """
        _sample_whole_body(self._track, time, waiting, self._target.block)
        return self._target


@compiled
def _sample_whole_body(track: Track, time: float, waiting: bool, block: np.ndarray) -> None:
    """Write the plan's sample into a target, angular velocity and acceleration in W's axes."""
    target = target_in(block)
    sample, body = sampled(track, time), target.body
    R = matrix_of(quaternion(sample.q[BASE_ORIENTATION]))
    omega, omega_rate = vector(sample.v[BASE_ANGULAR]), vector(sample.vdot[BASE_ANGULAR])
    for i in range(3):
        body.com[i], body.com_velocity[i] = sample.com[i], sample.com_velocity[i]
        body.com_acceleration[i] = sample.com_acceleration[i]
        body.angular_velocity[i] = R[i][0] * omega[0] + R[i][1] * omega[1] + R[i][2] * omega[2]
        body.angular_acceleration[i] = R[i][0] * omega_rate[0] + R[i][1] * omega_rate[1] + R[i][2] * omega_rate[2]
    body.orientation[:] = sample.q[BASE_ORIENTATION]
    target.joint_position[:] = sample.q[JOINT_POSITION]
    moving = 0.0 if waiting else 1.0
    target.joint_velocity[:] = moving * sample.v[JOINT_VELOCITY]
    target.joint_acceleration[:] = moving * sample.vdot[JOINT_VELOCITY]
    target.angular_momentum[:] = sample.angular_momentum
    target.angular_momentum_rate[:] = sample.angular_momentum_rate
    target.force[:] = sample.force
    target.contact[:] = sample.contact
