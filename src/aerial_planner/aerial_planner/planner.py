"""Motion in, checked plan out: the planner's block diagram."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerial_model.errors import ConfigurationError, RefusalCode, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.estimate import Estimate
from aerial_model.values.plan import Plan
from aerial_model.values.request import MotionRequest
from aerial_planner.assembly import flight
from aerial_planner.assembly.assemble import ActuatorUse, actuator_use, assemble, with_held_joints
from aerial_planner.assembly.checks import ACTUATOR_TOLERANCE, VIOLATION_TOLERANCE, check, clearance_deficit
from aerial_planner.assembly.collision import CollisionModel
from aerial_planner.assembly.library import PlanLibrary
from aerial_planner.codegen.batch import no_machine_code
from aerial_planner.codegen.library import FunctionLibrary
from aerial_planner.feasibility import screen
from aerial_planner.formulation.kino_dynamic import KinoDynamic
from aerial_planner.formulation.limits import Margin, Variant
from aerial_planner.formulation.srbm import SingleRigidBody
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.kinematics.base_frame import base_frame_model
from aerial_planner.kinematics.inverse_kinematics import InverseKinematics
from aerial_planner.motion.schedule import Motion, Schedule, contact_schedule, load_motion
from aerial_planner.motion.start import Start
from aerial_planner.ocp import interior_point
from aerial_planner.ocp.options import SolverName, SolverOptions
from aerial_planner.ocp.problem import Solution
from aerial_planner.ocp.stage import StageKind
from aerial_planner.reference.body import Reference, body_reference
from aerial_planner.refinement import Attempt, Outcome
from aerial_planner.settings import PlannerSettings

_TOLERANCE = 3e-4  # of the optimum: tighter ones cost two iterations and gain a hundred-thousandth of the cost
_BARRIER_ACCURACY = 300.0  # of our own solver: a tenth fewer iterations of rolls and flips than with the others' 100
_ITERATIONS_MAX = 50  # of one solve: those that succeed take 10 to 40
_ITERATIONS_OF_REQUEST = 100  # after which nothing else is tried, so that a refusal takes no longer than a plan
_TOUCH_RISE = 0.02  # [m] by which to fly higher when a link would touch the terrain
_CLEARANCE_SPARE = 0.01  # [m] added to a miss, since the pose at the edge changes with the flight

Progress = Callable[[str, int, float], None]  # stage, iterations so far, residual


@dataclass(frozen=True, kw_only=True)
class PlanReport:
    """The figures of one planning request; field names are the command line's JSON keys."""

    motion: str
    robot: str
    variant: str
    warm_start: bool
    optimize_timing: bool
    started_from: str  # "library", "srbm" or "reference"; empty if nothing was optimized
    solver: str
    success: bool
    total_time_s: float
    solve_time_s: float
    srbm_time_s: float
    iterations: int
    cost: float | None
    max_violation: float | None
    peak_torque_ratio: float | None
    peak_voltage_ratio: float | None
    peak_speed_ratio: float | None
    take_off_time_s: float | None
    flight_time_s: float | None
    rotation_deg: list[float] | None
    landing_position_m: list[float] | None
    refusal: dict[str, str] | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain JSON types."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class PlanningResult:
    """A checked plan, in the start heading frame, and its figures."""

    plan: Plan
    report: PlanReport
    actuator_use: ActuatorUse


@dataclass
class _Clock:
    """Sums the time and iterations of the solves of one request."""

    started: float
    solve: float = 0.0
    srbm: float = 0.0
    iterations: int = 0
    started_from: str = ""  # where the last solve of the kino-dynamic stage began


class Planner:
    """Plans motions of one robot; problems are built once per contact schedule and reused.

    Args:
        robot: that moves.
        solver: one of ``SolverName``.
        settings: None: the robot's.
        cache: folder of compiled functions (see ``compiled``); None: evaluate interpreted ones.
        actuator_tolerance: exact torque, voltage or speed over its limit from which a plan is refused; infinite to see
            what a plan asks for that is not refused for it.
        plans: made before; the nearest one replaces the single rigid body as start, and new ones are added. With it,
            equal requests need not give plans equal to the last bit.

    Raises:
        ConfigurationError: if there is no such solver.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        solver: str = SolverName.RICCATI,
        settings: PlannerSettings | None = None,
        cache: Path | None = None,
        actuator_tolerance: float = ACTUATOR_TOLERANCE,
        plans: PlanLibrary | None = None,
    ) -> None:
        self.robot = robot
        self.actuator_tolerance = actuator_tolerance
        self.plans = plans
        self.settings = settings or robot.section("planner", PlannerSettings)
        self._library = FunctionLibrary(cache) if cache else None
        if solver not in list(SolverName):
            raise ConfigurationError(f"solver: expected one of {', '.join(SolverName)}, found '{solver}'")
        self.options = SolverOptions(solver=solver, tolerance=_TOLERANCE, max_iterations=_ITERATIONS_MAX)
        if solver == SolverName.RICCATI:
            self.options = dataclasses.replace(self.options, barrier_accuracy=_BARRIER_ACCURACY)
        self._body = robot.planned
        machine_code = self._library.load_function if self._library else no_machine_code
        self._model = base_frame_model(self._body, machine_code)
        interior_point.rehearse()
        flight.rehearse()
        self._ik = InverseKinematics(self._body, self._model, machine_code)
        self._batches = (*self._model.batches, self._ik.feet)
        for batch in self._batches:
            batch.memory(1)  # which looks for machine code
        self._srbm = SingleRigidBody(self._body, self._model, self._ik, self.settings, self.options, self._library)
        self._collisions = CollisionModel(robot)
        self._kino_dynamic: dict[tuple[Variant, bool], KinoDynamic] = {}

    def plan(
        self, request: MotionRequest, start: Start | Estimate | None = None, progress: Progress | None = None
    ) -> PlanningResult:
        """Return a checked plan.

        Args:
            request: motion, goal and terrain.
            start: state and contacts to start from, or the estimate of a robot that stands; None: its home stance.
            progress: called after each stage.

        Raises:
            RefusalError: if the motion or goal is unknown, out of reach, or its plan fails a check; says what binds.
        """
        clock = _Clock(started=time.perf_counter())
        try:
            return self._plan(request, start, progress or (lambda *_: None), clock)
        except RefusalError as refusal:
            refusal.report = self._report(request, clock, refusal=refusal)
            raise

    def warm_up(self, request: MotionRequest) -> None:
        """Build the problems of a request's schedule, so that its first plan is as fast as later ones."""
        schedule = self._schedule(request, load_motion(request.motion, self.robot))
        self._srbm.problem(schedule, near=True)
        self._stage(request).problem(schedule)
        if self.plans is not None:
            self._stage(request).problem(schedule, near=True)

    def compile(self, requests: Iterable[MotionRequest], progress: Callable[[str], None]) -> int:
        """Compile what plans of these requests evaluate, unless it is there; return how many libraries that were.

        Args:
            requests: one of each contact schedule and variant.
            progress: told the name of each before it is compiled.

        Raises:
            CompilationError: if there is no C compiler, or it fails.
            ValueError: if the planner has no cache.
        """
        if self._library is None:
            raise ValueError("a planner without a cache has nowhere to compile to")
        kinds: dict[str, StageKind] = {}
        for request in requests:
            schedule = self._schedule(request, load_motion(request.motion, self.robot))
            for stage in (self._srbm, self._stage(request)):
                kinds.update((kind.name, kind) for kind in stage.kinds(schedule))
        compiled = 0
        for name, kind in kinds.items():
            if not self._library.has(kind):
                progress(name)
                compiled += self._library.compile(kind)
        for batch in self._batches:
            if self._library.load_function(batch.function) is None:
                progress(batch.function.name())
                compiled += self._library.compile_function(batch.function)
                batch.renew()
        return compiled

    def _plan(
        self, request: MotionRequest, start: Start | Estimate | None, progress: Progress, clock: _Clock
    ) -> PlanningResult:
        stage = self._stage(request)
        motion = load_motion(request.motion, self.robot)
        begin = self._start(start)
        first = Attempt(request=request, margin=Margin.usual(self.robot, self.settings))
        attempt, most = first, _ITERATIONS_OF_REQUEST
        good: Outcome | None = None  # the last that may be handed out, should a better one not be found
        while True:
            outcome = None
            try:
                outcome = self._outcome(attempt, stage, motion, begin, progress, clock)
                better = None
                if outcome.is_feasible and clock.iterations <= most:
                    better = outcome.attempt.improved(outcome, self.robot, self.settings, stage.variant)
                if better is not None:
                    good = outcome if self._refusal(outcome) is None else good
                    attempt = better
                    continue
                refusal = self._refusal(outcome)
                if refusal is not None:
                    raise refusal
                missing, reason = self._missing_height(outcome.plan)
            except RefusalError:
                if good is not None:
                    outcome, good = good, None
                    missing, reason = self._missing_height(outcome.plan)
                elif outcome is not None and outcome.is_poor and clock.started_from != "reference":
                    attempt = replace(first, request=replace(request, warm_start=False))
                    most = clock.iterations + _ITERATIONS_OF_REQUEST
                    continue
                else:
                    raise
            plan, solution, use = outcome.plan, outcome.solution, outcome.use
            if missing == 0.0:
                progress("checked", clock.iterations, solution.max_violation)
                if self.plans is not None:
                    self.plans.add(plan)
                report = self._report(request, clock, plan=plan, solution=solution, use=use)
                return PlanningResult(plan=plan, report=report, actuator_use=use)
            if clock.iterations > most:
                what = "platform edge" if request.terrain.boxes else "foot clearance"
                raise RefusalError(RefusalCode.CHECK_FAILED, f"{what}: {reason}, also on a higher flight")
            rise = float(plan.com[:, 2].max()) - plan.landing_com_height + missing + _CLEARANCE_SPARE
            attempt = replace(outcome.attempt, least_rise=rise, rounds=0)
            good = None  # it does not clear the terrain

    def _outcome(
        self,
        attempt: Attempt,
        stage: KinoDynamic,
        motion: Motion,
        start: Start,
        progress: Progress,
        clock: _Clock,
    ) -> Outcome:
        """Return what comes of an attempt.

        Raises:
            RefusalError: if its goal or terrain cannot be, or not even a single rigid body gets there.
        """
        request = attempt.request
        schedule = attempt.schedule(self._schedule(request, motion, attempt.least_rise))
        reference = body_reference(schedule, start, self._body, self._model, self._ik, self.settings)
        screen(request, schedule, reference, self._body)
        if attempt.take_off is None:
            take_off, solution = self._take_off(request, stage, schedule, reference, progress, clock)
        else:  # the plan that was not good enough is near
            take_off, solution = self._optimize(
                stage, schedule, reference, attempt.take_off, progress, clock, margin=attempt.margin
            )
        plan = with_held_joints(assemble(request, self._body, self._model, schedule, reference, take_off), self.robot)
        return Outcome(
            attempt=replace(attempt, take_off=take_off),
            from_a_plan=attempt.take_off is not None,
            schedule=schedule,
            reference=reference,
            solution=solution,
            plan=plan,
            use=actuator_use(plan, self.robot),
        )

    def _refusal(self, outcome: Outcome) -> RefusalError | None:
        """Return why a plan must not be handed out, whatever the terrain."""
        try:
            check(outcome.plan, outcome.schedule, outcome.solution, outcome.use, self.robot, self.actuator_tolerance)
        except RefusalError as refusal:
            return refusal
        return None

    def _missing_height(self, plan: Plan) -> tuple[float, str]:
        """Return by how much a plan should fly higher over the terrain [m], and why; 0 if feet and links clear it.

        Raises:
            RefusalError: if links touch where more height does not help.
        """
        deficit = clearance_deficit(plan, self.robot)
        touch = self._collisions.first_touch(plan)
        if touch is None:
            return deficit, f"a foot would pass {100 * deficit:.1f} cm too low"
        if touch.is_terrain and plan.take_off_time < touch.time < plan.landing_time:
            return max(deficit, _TOUCH_RISE), str(touch)
        what = "platform edge" if touch.is_terrain else "self-collision"
        raise RefusalError(RefusalCode.CHECK_FAILED, f"{what}: {touch}")

    def _take_off(
        self,
        request: MotionRequest,
        stage: KinoDynamic,
        schedule: Schedule,
        reference: Reference,
        progress: Progress,
        clock: _Clock,
    ) -> tuple[TakeOffTrajectory, Solution]:
        """Return the optimum from the nearest stored plan, or if there is none or it misled, from the usual guess."""
        stored = self.plans.nearest(schedule, reference) if self.plans is not None and request.warm_start else None
        if stored is not None:
            clock.started_from = "library"
            take_off, solution = self._optimize(stage, schedule, reference, stored, progress, clock, near=True)
            if solution.max_violation <= VIOLATION_TOLERANCE:
                return take_off, solution
        guess = self._guess(request, schedule, reference, progress, clock)
        return self._optimize(stage, schedule, reference, guess, progress, clock)

    def _guess(
        self, request: MotionRequest, schedule: Schedule, reference: Reference, progress: Progress, clock: _Clock
    ) -> TakeOffTrajectory:
        """Return where the kino-dynamic stage starts: the single-rigid-body optimum, or the bare reference.

        The latter, too, where a single rigid body went astray though nothing binds it, as some that spin do.
        """
        clock.started_from = "reference"
        if not request.warm_start:
            return self._srbm.reference_trajectory(schedule, reference)
        began = time.perf_counter()
        guess, solution = self._srbm.solve(schedule, reference)
        clock.srbm += time.perf_counter() - began
        clock.iterations += solution.iterations
        progress("srbm", clock.iterations, solution.max_violation)
        if not solution.converged and not solution.binding:
            return self._srbm.reference_trajectory(schedule, reference)
        if not solution.converged:
            raise RefusalError(
                RefusalCode.OUT_OF_REACH,
                f"out of reach: even a single rigid body with the robot's legs cannot leave the ground so as to land at "
                f"{_position(request)} after {schedule.flight_time:.2f} s of flight; "
                f"what binds: {', '.join(solution.binding[:3])}",
            )
        clock.started_from = "srbm"
        return guess

    def _optimize(
        self,
        stage: KinoDynamic,
        schedule: Schedule,
        reference: Reference,
        guess: TakeOffTrajectory,
        progress: Progress,
        clock: _Clock,
        *,
        near: bool = False,
        margin: Margin | None = None,
    ) -> tuple[TakeOffTrajectory, Solution]:
        began = time.perf_counter()
        take_off, solution = stage.solve(schedule, reference, guess, near=near, margin=margin)
        clock.solve += time.perf_counter() - began
        clock.iterations += solution.iterations
        progress("kino_dynamic", clock.iterations, solution.max_violation)
        return take_off, solution

    def _schedule(self, request: MotionRequest, motion: Motion, least_rise: float = 0.0) -> Schedule:
        settings = self.settings
        return contact_schedule(request, motion, self._body, settings.dt, settings.flight_knots, least_rise)

    def _stage(self, request: MotionRequest) -> KinoDynamic:
        """Return the kino-dynamic stage of the request's variant, with or without the timing optimized."""
        key = self._variant(request), request.optimize_timing
        if key not in self._kino_dynamic:
            self._kino_dynamic[key] = KinoDynamic(
                self.robot, self._model, self.settings, key[0], self.options, self._library, timed=key[1]
            )
        return self._kino_dynamic[key]

    def _variant(self, request: MotionRequest) -> Variant:
        try:
            return Variant(request.variant or Variant.AAKD_STAR)
        except ValueError:
            known = ", ".join(Variant)
            raise RefusalError(
                RefusalCode.INVALID_REQUEST, f"unknown variant '{request.variant}'; known: {known}"
            ) from None

    def _start(self, start: Start | Estimate | None) -> Start:
        """Return the start of the planned robot."""
        if start is None:
            return Start.standing(self._body)
        return (Start.at(self.robot, start) if isinstance(start, Estimate) else start).planned(self.robot)

    def _report(
        self,
        request: MotionRequest,
        clock: _Clock,
        *,
        plan: Plan | None = None,
        solution: Solution | None = None,
        use: ActuatorUse | None = None,
        refusal: RefusalError | None = None,
    ) -> PlanReport:
        return PlanReport(
            motion=request.motion,
            robot=self.robot.name,
            variant=request.variant,
            warm_start=request.warm_start,
            optimize_timing=request.optimize_timing,
            started_from=clock.started_from,
            solver=self.options.solver,
            success=plan is not None,
            total_time_s=time.perf_counter() - clock.started,
            solve_time_s=clock.solve,
            srbm_time_s=clock.srbm,
            iterations=clock.iterations,
            cost=None if solution is None else solution.cost,
            max_violation=None if solution is None else solution.max_violation,
            peak_torque_ratio=None if use is None else float(use.torque_ratio.max()),
            peak_voltage_ratio=None if use is None else float(use.voltage_ratio.max()),
            peak_speed_ratio=None if use is None else float(use.speed_ratio.max()),
            take_off_time_s=None if plan is None else plan.take_off_time,
            flight_time_s=None if plan is None else plan.landing_time - plan.take_off_time,
            rotation_deg=None if plan is None else np.rad2deg(plan.rotation).tolist(),
            landing_position_m=None if plan is None else plan.landing_support_centre.tolist(),
            refusal=None if refusal is None else {"code": refusal.code.value, "reason": refusal.reason},
        )


def _position(request: MotionRequest) -> str:
    return "({:.2f}, {:.2f}, {:.2f}) m".format(*request.displacement)
