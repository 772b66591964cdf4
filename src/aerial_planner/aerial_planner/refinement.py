"""Which attempt at a request comes next, given what came of the last; which outcome is the best; when to give up.

The optimizer's model is exact but for what it takes from its guess (the legs' inertia, their path in the air) and what it
leaves out (velocity terms, the arms' part in where feet land). What that does to a plan is measured on the plan.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Plan
from aerial_model.values.request import MotionRequest
from aerial_planner.assembly.actuator_use import ActuatorUse
from aerial_planner.assembly.checks import VIOLATION_TOLERANCE, PlanChecks, Shortfall
from aerial_planner.assembly.touchdown import arms_shift, attitude_miss
from aerial_planner.formulation.limits import Margin, Variant
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.motion.schedule import Schedule
from aerial_planner.ocp.problem import Solution
from aerial_planner.reference.body import Reference
from aerial_planner.report import SolveLog
from aerial_planner.settings import PlannerSettings

_EXACT_SHARE = 0.95  # of the limits is what exact torques may take; the rest is the controller's
_ROUNDS, _LAST_SHARE = 3, 1.03  # after so many rounds this share is good enough
_IMPROVEMENTS = 12  # that are tried at the most
_ITERATIONS = 100  # after which nothing else is tried, so that a refusal takes no longer than a plan
_TIGHTENING = 0.98  # by which limits are lowered further than exact torques were beyond that, and folding slowed down
_WORTH_CORRECTING = np.deg2rad(1.5)  # by which a finely integrated flight may miss its attitude [rad]
_WORTH_MOVING = 0.015  # by which feet may be off where they should land, over the height of the centre of mass
_CORRECTABLE = np.deg2rad(30.0)  # beyond this it is another motion [rad]
_CUT_SHORT = 1.01  # times the shortest flight
_CLEARANCE_SPARE = 0.01  # [m] added to a shortfall, since the pose at the edge changes with the flight


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """Demands on the optimizer that go beyond the request's ``Schedule``."""

    request: MotionRequest
    margin: Margin
    least_rise: float = 0.0  # of the flight [m]
    folding_time: float = 0.0  # [s]
    arms_shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    landing_speed: float | None = None
    correction: np.ndarray = field(default_factory=lambda: np.zeros(3))
    take_off: TakeOffTrajectory | None = None  # where to start: the optimum of the attempt before
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
        better = self._aimed(outcome, robot)
        if variant is not Variant.KD:
            better = better._eased(outcome, robot, settings)
        return None if better is self else replace(better, number=self.number + 1)

    def _aimed(self, outcome: Outcome, robot: Robot) -> Attempt:
        """Return the attempt with the attitude at touchdown corrected, and the place of the feet then; this one if they are right."""
        plan, reference, aimed = outcome.plan, outcome.reference, self
        miss = attitude_miss(plan, outcome.schedule)
        if _WORTH_CORRECTING < np.linalg.norm(miss) < _CORRECTABLE:
            aimed = replace(aimed, correction=self.correction - miss)
        tolerance = _WORTH_MOVING * plan.landing_com_height
        shift = arms_shift(plan, robot, robot.with_held(reference.landing_joint_position))
        if np.linalg.norm(shift - self.arms_shift) > tolerance:
            aimed = replace(aimed, arms_shift=shift)
        speed = float(np.linalg.norm(plan.com_velocity[-1, :2]))
        if reference.landing_lead_time * abs(speed - reference.landing_speed) > tolerance:
            aimed = replace(aimed, landing_speed=speed)
        return aimed

    def _eased(self, outcome: Outcome, robot: Robot, settings: PlannerSettings) -> Attempt:
        """Return the attempt with exact torques kept off the limits; this one if they are.

        Limits are lowered for joints that come too near, or folding is slowed down. The first time, the legs' inertia was
        that of other poses: another start may be all it takes.
        """
        use, schedule, path = outcome.use, outcome.schedule, outcome.reference.flight_path
        share = _EXACT_SHARE if self.rounds < _ROUNDS else _LAST_SHARE
        eased, over = self, use.in_take_off / share
        if np.any(over > 1.0):
            tightened = _tightened(self.margin.take_off, over) if outcome.from_a_plan else self.margin.take_off
            eased = replace(eased, margin=replace(self.margin, take_off=tightened))
        haste = np.sqrt(use.in_flight.max() / share)
        longest = path.ready / schedule.flight_knots * schedule.flight_time
        over = use.at_lift_off / share
        over[robot.arms] = use.in_flight[robot.arms] / share
        if haste > 1.0 and self.folding_time < longest:
            folding = max(path.settling_time, path.turning / schedule.flight_knots * schedule.flight_time)
            eased = replace(eased, folding_time=min(folding * haste / _TIGHTENING, longest))
        elif np.any(over > 1.0):  # the legs cannot take longer: they must leave the ground slower
            least = np.minimum(self.margin.flight, settings.margin)
            eased = replace(eased, margin=replace(eased.margin, flight=_tightened(least, over)))
        return eased if eased is self else replace(eased, rounds=self.rounds + 1)


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
        attempt, take_off = self.attempt, self.attempt.take_off
        if not self.is_feasible or not attempt.request.warm_start or attempt.least_rise > 0.0 or take_off is None:
            return False
        return take_off.flight_time < _CUT_SHORT * self.schedule.flight_time_range[0]


class Refinement:
    """The search for a plan of one request: attempts, each given what came of the one before.

    Args:
        first: attempt.
        carry_out: makes an attempt; raises ``RefusalError`` if its goal or terrain cannot be.
        checks: that decide whether a plan may be handed out.
        variant: whose limits count.
        settings: of the planner.
        log: of the request's solves.
    """

    def __init__(
        self,
        first: Attempt,
        carry_out: Callable[[Attempt], Outcome],
        checks: PlanChecks,
        variant: Variant,
        settings: PlannerSettings,
        log: SolveLog,
    ) -> None:
        self._first, self._carry_out, self._checks = first, carry_out, checks
        self._variant, self._settings, self._log = variant, settings, log
        self._iterations_max = _ITERATIONS
        self._fallback: Outcome | None = None  # the last that may be handed out, should a better one not be found
        self._accepted: Outcome | None = None

    def best(self) -> Outcome:
        """Return the best outcome.

        Raises:
            RefusalError: if none passes the checks; says what binds.
        """
        attempt: Attempt | None = self._first
        while attempt is not None:
            attempt = self._after(attempt)
        assert self._accepted is not None
        return self._accepted

    def _after(self, attempt: Attempt) -> Attempt | None:
        """Carry out an attempt and return the next one; None if its outcome or the fallback is accepted."""
        outcome = None
        try:
            outcome = self._carry_out(attempt)
            better = self._improved(outcome)
            if better is not None:
                return better
            self._checks.check(outcome.plan, outcome.schedule, outcome.solution, outcome.use)
            shortfall = self._checks.shortfall(outcome.plan)
        except RefusalError:
            if self._fallback is not None:
                outcome, self._fallback = self._fallback, None
                shortfall = self._checks.shortfall(outcome.plan)
            elif outcome is not None and outcome.is_poor and self._log.started_from != "reference":
                self._iterations_max = self._log.iterations + _ITERATIONS
                return replace(self._first, request=replace(self._first.request, warm_start=False))
            else:
                raise
        if shortfall.height > 0.0:
            return self._higher(outcome, shortfall)
        self._accepted = outcome
        return None

    def _improved(self, outcome: Outcome) -> Attempt | None:
        """Return an attempt at a better plan, with this outcome to fall back on; None if this one is to be judged."""
        if not outcome.is_feasible or self._is_spent:
            return None
        better = outcome.attempt.improved(outcome, self._checks.robot, self._settings, self._variant)
        if better is not None and self._checks.passes(outcome.plan, outcome.schedule, outcome.solution, outcome.use):
            self._fallback = outcome
        return better

    def _higher(self, outcome: Outcome, shortfall: Shortfall) -> Attempt:
        """Return the attempt with a flight that clears the terrain."""
        if self._is_spent:
            what = "platform edge" if outcome.plan.terrain.boxes else "foot clearance"
            raise RefusalError(RefusalCode.CHECK_FAILED, f"{what}: {shortfall.reason}, also on a higher flight")
        self._fallback = None  # it does not clear the terrain
        plan = outcome.plan
        rise = float(plan.com[:, 2].max()) - plan.landing_com_height + shortfall.height + _CLEARANCE_SPARE
        return replace(outcome.attempt, least_rise=rise, rounds=0)

    @property
    def _is_spent(self) -> bool:
        return self._log.iterations > self._iterations_max


def _tightened(margin: np.ndarray, over: np.ndarray) -> np.ndarray:
    """Return shares of limits ``(n,)``, less where exact torques were ``over`` times what they may be."""
    return np.where(over > 1.0, margin * _TIGHTENING / np.maximum(over, 1.0), margin)
