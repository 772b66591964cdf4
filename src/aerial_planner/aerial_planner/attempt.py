"""One attempt at a request after the other: what the next is asked for, given what came of the last.

The optimizer's model is exact but for what it takes from its guess (the legs' inertia, their way in the air) and what it
leaves out (velocity terms, the arms' part in where feet land). What that does to a plan is measured on the plan.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from aerial_model.plan import Plan
from aerial_model.robot import Robot
from aerial_planner.assembly import ActuatorUse, arms_shift
from aerial_planner.checks import VIOLATION_TOLERANCE, attitude_miss
from aerial_planner.limits import Margin, Variant
from aerial_planner.reference import Reference
from aerial_planner.schedule import Schedule
from aerial_planner.settings import PlannerSettings
from aerial_planner.trajectory import TakeOffTrajectory
from aerial_planner.transcription import Solution

_EXACT_SHARE = 0.95  # of the limits is what exact torques may take; the rest is the controller's
_ROUNDS, _LAST_SHARE = 3, 1.03  # after so many attempts this share is good enough
_TIGHTENING = 0.98  # by which limits are lowered further than exact torques were beyond that, and folding slowed down
_WORTH_CORRECTING = np.deg2rad(1.5)  # by which a finely integrated flight may miss its attitude [rad]
_WORTH_MOVING = 0.015  # by which feet may be off where they should land, over the height of the centre of mass
_CORRECTABLE = np.deg2rad(30.0)  # beyond this it is another motion [rad]
_CUT_SHORT = 1.01  # times the shortest flight


class Outcome(NamedTuple):
    """What came of an attempt."""

    schedule: Schedule
    reference: Reference
    take_off: TakeOffTrajectory
    solution: Solution
    plan: Plan
    use: ActuatorUse

    @property
    def cut_short(self) -> bool:
        """Whether it is an optimum with a flight as short as may be: poor local ones are like that."""
        if self.solution.max_violation > VIOLATION_TOLERANCE:
            return False
        return self.take_off.flight_time < _CUT_SHORT * self.schedule.flight_time_range[0]


@dataclass
class Attempt:
    """What is asked of the optimizer; it changes from one attempt at a request to the next."""

    margin: Margin
    rounds: int = 0  # of judging exact torques
    least_rise: float = 0.0  # of the flight [m]
    folding_time: float = 0.0  # see ``Schedule`` [s]
    arms_shift: np.ndarray = field(default_factory=lambda: np.zeros(3))  # see ``Schedule``
    landing_speed: float | None = None  # see ``Schedule``
    correction: np.ndarray = field(default_factory=lambda: np.zeros(3))  # see ``Schedule``
    take_off: TakeOffTrajectory | None = None  # that the attempt before came to

    def schedule(self, usual: Schedule) -> Schedule:
        """Return the schedule of the request with what is asked for."""
        return replace(
            usual,
            correction=self.correction,
            arms_shift=self.arms_shift,
            landing_speed=self.landing_speed,
            folding_time=self.folding_time,
        )

    def improve(
        self, outcome: Outcome, robot: Robot, settings: PlannerSettings, variant: Variant, *, again: bool
    ) -> bool:
        """Ask for what would make a plan better; return whether anything would.

        Args:
            outcome: of this attempt.
            robot: the whole robot.
            settings: of the planner.
            variant: whose limits count.
            again: it started from a plan: then the legs' inertia was that of nearly the same poses.
        """
        aimed = self._aim(outcome, robot)
        return (variant is not Variant.KD and self._ease(outcome, robot, settings, again=again)) or aimed

    def _aim(self, outcome: Outcome, robot: Robot) -> bool:
        """Correct the attitude at touchdown, and where the feet are to be then."""
        plan, reference, improved = outcome.plan, outcome.reference, False
        miss = attitude_miss(plan, outcome.schedule)
        if _WORTH_CORRECTING < np.linalg.norm(miss) < _CORRECTABLE:
            self.correction = self.correction - miss
            improved = True
        little = _WORTH_MOVING * plan.landing_com_height
        shift = arms_shift(plan, robot)
        if np.linalg.norm(shift - self.arms_shift) > little:
            self.arms_shift = shift
            improved = True
        speed = float(np.linalg.norm(plan.com_velocity[-1, :2]))
        if reference.landing_lead_time * abs(speed - reference.landing_speed) > little:
            self.landing_speed = speed
            improved = True
        return improved

    def _ease(self, outcome: Outcome, robot: Robot, settings: PlannerSettings, *, again: bool) -> bool:
        """Lower the limits of joints whose exact torques are too near to them, and have the legs fold more slowly."""
        use, schedule, path = outcome.use, outcome.schedule, outcome.reference.flight_path
        self.rounds += 1
        share = _EXACT_SHARE if self.rounds <= _ROUNDS else _LAST_SHARE
        over = use.in_take_off / share
        improved = bool(np.any(over > 1.0))
        if improved and again:
            self.margin = replace(self.margin, take_off=_tightened(self.margin.take_off, over))
        haste = np.sqrt(use.in_flight.max() / share)
        longest = path.ready / schedule.flight_knots * schedule.flight_time
        if haste > 1.0 and self.folding_time < longest:
            folding = max(path.settling_time, path.turning / schedule.flight_knots * schedule.flight_time)
            self.folding_time = min(folding * haste / _TIGHTENING, longest)
            return True
        over = use.at_lift_off / share
        over[robot.arms] = use.in_flight[robot.arms] / share
        if np.any(over > 1.0):  # the legs cannot take longer: they must leave the ground slower
            least = np.minimum(self.margin.flight, settings.margin)
            self.margin = replace(self.margin, flight=_tightened(least, over))
            improved = True
        return improved


def _tightened(margin: np.ndarray, over: np.ndarray) -> np.ndarray:
    """Return shares of limits ``(n,)``, less where exact torques were ``over`` times what they may be."""
    return np.where(over > 1.0, margin * _TIGHTENING / np.maximum(over, 1.0), margin)
