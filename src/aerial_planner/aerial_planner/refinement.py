"""One attempt at a request after the other: what the next is asked for, given what came of the last.

The optimizer's model is exact but for what it takes from its guess (the legs' inertia, their way in the air) and what it
leaves out (velocity terms, the arms' part in where feet land). What that does to a plan is measured on the plan.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Plan
from aerial_model.values.request import MotionRequest
from aerial_planner.assembly.assemble import ActuatorUse, arms_shift
from aerial_planner.assembly.checks import VIOLATION_TOLERANCE, attitude_miss
from aerial_planner.formulation.limits import Margin, Variant
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.motion.schedule import Schedule
from aerial_planner.ocp.problem import Solution
from aerial_planner.reference.body import Reference
from aerial_planner.settings import PlannerSettings

_EXACT_SHARE = 0.95  # of the limits is what exact torques may take; the rest is the controller's
_ROUNDS, _LAST_SHARE = 3, 1.03  # after so many rounds this share is good enough
_IMPROVEMENTS = 12  # that are tried at the most
_TIGHTENING = 0.98  # by which limits are lowered further than exact torques were beyond that, and folding slowed down
_WORTH_CORRECTING = np.deg2rad(1.5)  # by which a finely integrated flight may miss its attitude [rad]
_WORTH_MOVING = 0.015  # by which feet may be off where they should land, over the height of the centre of mass
_CORRECTABLE = np.deg2rad(30.0)  # beyond this it is another motion [rad]
_CUT_SHORT = 1.01  # times the shortest flight


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """What is asked of the optimizer; see ``Schedule`` for what is not said here."""

    request: MotionRequest
    margin: Margin
    least_rise: float = 0.0  # of the flight [m]
    folding_time: float = 0.0  # [s]
    arms_shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    landing_speed: float | None = None
    correction: np.ndarray = field(default_factory=lambda: np.zeros(3))
    take_off: TakeOffTrajectory | None = None  # where to start: what the attempt before came to
    rounds: int = 0  # in which exact torques were too near to the limits
    number: int = 0  # of improvements

    def schedule(self, usual: Schedule) -> Schedule:
        """Return the schedule of the request with what is asked for."""
        return replace(
            usual,
            correction=self.correction,
            arms_shift=self.arms_shift,
            landing_speed=self.landing_speed,
            folding_time=self.folding_time,
        )

    def improved(self, outcome: Outcome, robot: Robot, settings: PlannerSettings, variant: Variant) -> Attempt | None:
        """Return an attempt at a better plan; None if nothing is worth it, or enough has been tried.

        Args:
            outcome: of this attempt.
            robot: the whole robot.
            settings: of the planner.
            variant: whose limits count.
        """
        if self.number == _IMPROVEMENTS:
            return None
        changes = self._aimed(outcome, robot)
        if variant is not Variant.KD:
            changes |= self._eased(outcome, robot, settings)
        return replace(self, number=self.number + 1, **changes) if changes else None

    def _aimed(self, outcome: Outcome, robot: Robot) -> dict[str, Any]:
        """Return what corrects the attitude at touchdown, and where the feet are to be then."""
        plan, reference = outcome.plan, outcome.reference
        changes: dict[str, Any] = {}
        miss = attitude_miss(plan, outcome.schedule)
        if _WORTH_CORRECTING < np.linalg.norm(miss) < _CORRECTABLE:
            changes["correction"] = self.correction - miss
        little = _WORTH_MOVING * plan.landing_com_height
        shift = arms_shift(plan, robot, robot.with_held(reference.landing_joint_position))
        if np.linalg.norm(shift - self.arms_shift) > little:
            changes["arms_shift"] = shift
        speed = float(np.linalg.norm(plan.com_velocity[-1, :2]))
        if reference.landing_lead_time * abs(speed - reference.landing_speed) > little:
            changes["landing_speed"] = speed
        return changes

    def _eased(self, outcome: Outcome, robot: Robot, settings: PlannerSettings) -> dict[str, Any]:
        """Return what keeps exact torques off the limits: lower ones for joints that come too near, slower folding.

        The first time, the legs' inertia was that of other poses: another start may be all it takes.
        """
        use, schedule, path = outcome.use, outcome.schedule, outcome.reference.flight_path
        share = _EXACT_SHARE if self.rounds < _ROUNDS else _LAST_SHARE
        changes: dict[str, Any] = {}
        margin, over = self.margin, use.in_take_off / share
        if np.any(over > 1.0):
            if outcome.from_a_plan:
                margin = replace(margin, take_off=_tightened(margin.take_off, over))
            changes["margin"] = margin
        haste = np.sqrt(use.in_flight.max() / share)
        longest = path.ready / schedule.flight_knots * schedule.flight_time
        over = use.at_lift_off / share
        over[robot.arms] = use.in_flight[robot.arms] / share
        if haste > 1.0 and self.folding_time < longest:
            folding = max(path.settling_time, path.turning / schedule.flight_knots * schedule.flight_time)
            changes["folding_time"] = min(folding * haste / _TIGHTENING, longest)
        elif np.any(over > 1.0):  # the legs cannot take longer: they must leave the ground slower
            least = np.minimum(margin.flight, settings.margin)
            changes["margin"] = replace(margin, flight=_tightened(least, over))
        return changes | {"rounds": self.rounds + 1} if changes else {}


class Outcome(NamedTuple):
    """What came of an attempt."""

    attempt: Attempt  # with the take-off it came to
    from_a_plan: bool  # whether it started from one of the same request
    schedule: Schedule
    reference: Reference
    solution: Solution
    plan: Plan
    use: ActuatorUse

    @property
    def is_feasible(self) -> bool:
        """Whether the optimizer's constraints hold."""
        return self.solution.max_violation <= VIOLATION_TOLERANCE

    @property
    def is_poor(self) -> bool:
        """Whether it is an optimum with a flight as short as may be, which another start might better."""
        attempt = self.attempt
        if not self.is_feasible or not attempt.request.warm_start or attempt.least_rise > 0.0:
            return False
        return attempt.take_off.flight_time < _CUT_SHORT * self.schedule.flight_time_range[0]


def _tightened(margin: np.ndarray, over: np.ndarray) -> np.ndarray:
    """Return shares of limits ``(n,)``, less where exact torques were ``over`` times what they may be."""
    return np.where(over > 1.0, margin * _TIGHTENING / np.maximum(over, 1.0), margin)
