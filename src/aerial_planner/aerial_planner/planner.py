"""Motion in, checked plan out: the planner's block diagram."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.estimate import Estimate
from aerial_model.values.request import MotionRequest
from aerial_planner.assembly.actuator_use import actuator_use
from aerial_planner.assembly.assemble import assemble, with_held_joints
from aerial_planner.assembly.checks import ACTUATOR_TOLERANCE, VIOLATION_TOLERANCE, PlanChecks
from aerial_planner.assembly.library import PlanLibrary
from aerial_planner.feasibility import screen
from aerial_planner.formulation.kino_dynamic import KinoDynamic
from aerial_planner.formulation.limits import Margin
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.motion.motion import Motion, load_motion
from aerial_planner.motion.schedule import Schedule, contact_schedule
from aerial_planner.motion.start import Start
from aerial_planner.ocp.options import SolverName
from aerial_planner.ocp.problem import Solution
from aerial_planner.reference.body import Reference, body_reference
from aerial_planner.refinement import Attempt, Outcome, Refinement
from aerial_planner.report import PlanningResult, PlanReport, Progress, SolveLog
from aerial_planner.settings import PlannerSettings
from aerial_planner.stages import Stages

__all__ = ["PlanReport", "Planner", "PlanningResult", "Progress"]


@dataclass(frozen=True, kw_only=True)
class _Task:
    """What all attempts at one request have in common."""

    motion: Motion
    start: Start  # of the planned robot
    stage: KinoDynamic
    log: SolveLog


class Planner:
    """Plans motions of one robot; problems are built once per contact schedule and reused.

    Args:
        robot: that moves.
        solver: one of ``SolverName``.
        settings: None: the robot's.
        cache: folder of compiled functions (see ``codegen``); None: evaluate interpreted ones.
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
        self.plans = plans
        self.settings = settings or robot.section("planner", PlannerSettings)
        self._stages = Stages(robot, self.settings, solver, cache)
        self._checks = PlanChecks(robot, actuator_tolerance)

    def plan(
        self,
        request: MotionRequest,
        start: Start | Estimate | None = None,
        progress: Progress | None = None,
        motion: Motion | None = None,
    ) -> PlanningResult:
        """Return a checked plan.

        Args:
            request: motion, goal and terrain.
            start: state and contacts to start from, or the estimate of a robot that stands; None: its home stance.
            progress: called after each stage.
            motion: instead of the robot's motion of the name that the request gives, which the plan bears all the same.

        Raises:
            RefusalError: if the motion or goal is unknown, out of reach, or its plan fails a check; says what binds.
        """
        log = SolveLog(request, self.robot, self._stages.options.solver, progress)
        try:
            task = self._task(request, motion or load_motion(request.motion, self.robot), start, log)
            first = Attempt(request=request, margin=Margin.usual(self.robot, self.settings))
            attempts = partial(self._outcome, task)
            best = Refinement(first, attempts, self._checks, task.stage.variant, self.settings, log).best()
        except RefusalError as refusal:
            refusal.report = log.failure(refusal)
            raise
        log.progress("checked", best.solution)
        if self.plans is not None:
            self.plans.add(best.plan)
        report = log.success(best.plan, best.solution, best.use)
        return PlanningResult(plan=best.plan, report=report, actuator_use=best.use)

    def _outcome(self, task: _Task, attempt: Attempt) -> Outcome:
        """Return what comes of an attempt.

        Raises:
            RefusalError: if its goal or terrain cannot be, or not even a single rigid body gets there.
        """
        request, stages, body = attempt.request, self._stages, self._stages.body
        schedule = attempt.schedule(self._schedule(request, task.motion, task.start, attempt.least_rise))
        reference = body_reference(schedule, task.start, body, stages.model, stages.ik, self.settings)
        screen(request, schedule, reference, body)
        take_off, solution = self._take_off(task, attempt, schedule, reference)
        plan = with_held_joints(assemble(request, body, stages.model, schedule, reference, take_off), self.robot)
        return Outcome(
            attempt=replace(attempt, take_off=take_off),
            from_a_plan=attempt.take_off is not None,
            schedule=schedule,
            reference=reference,
            solution=solution,
            plan=plan,
            use=actuator_use(plan, self.robot),
        )

    def _take_off(
        self, task: _Task, attempt: Attempt, schedule: Schedule, reference: Reference
    ) -> tuple[TakeOffTrajectory, Solution]:
        """Return the optimum from the attempt's own start, the nearest stored plan, or a single rigid body's optimum."""
        solve = partial(task.stage.solve, schedule, reference)
        if attempt.take_off is not None:  # the plan that was not good enough is near
            return task.log.timed("kino_dynamic", partial(solve, attempt.take_off, margin=attempt.margin))
        warm = attempt.request.warm_start
        stored = self.plans.nearest(schedule, reference) if self.plans is not None and warm else None
        if stored is not None:
            task.log.started_from = "library"
            take_off, solution = task.log.timed("kino_dynamic", partial(solve, stored, near=True))
            if solution.max_violation <= VIOLATION_TOLERANCE:
                return take_off, solution  # else it misled
        guess = self._guess(task, attempt.request, schedule, reference)
        return task.log.timed("kino_dynamic", partial(solve, guess))

    def _guess(
        self, task: _Task, request: MotionRequest, schedule: Schedule, reference: Reference
    ) -> TakeOffTrajectory:
        """Return where the kino-dynamic stage starts: the single-rigid-body optimum, or the bare reference.

        The latter, too, where a single rigid body went astray though nothing binds it, as some that spin do.
        """
        log, srbm = task.log, self._stages.srbm
        log.started_from = "reference"
        if not request.warm_start:
            return srbm.reference_trajectory(schedule, reference)
        guess, solution = log.timed("srbm", partial(srbm.solve, schedule, reference))
        if not solution.converged and not solution.binding:
            return srbm.reference_trajectory(schedule, reference)
        if not solution.converged:
            x, y, z = request.displacement
            raise RefusalError(
                RefusalCode.OUT_OF_REACH,
                f"out of reach: even a single rigid body with the robot's legs cannot leave the ground so as to land at "
                f"({x:.2f}, {y:.2f}, {z:.2f}) m after {schedule.flight_time:.2f} s of flight; "
                f"what binds: {', '.join(solution.binding[:3])}",
            )
        log.started_from = "srbm"
        return guess

    def warm_up(self, request: MotionRequest) -> None:
        """Build the problems of a request's schedule, so that its first plan is as fast as later ones."""
        self._stages.build(request, self._standing_schedule(request), near=self.plans is not None)

    def compile(self, requests: Iterable[MotionRequest], progress: Callable[[str], None]) -> int:
        """Compile what plans of these requests evaluate, unless it is there; return how many libraries that were.

        Args:
            requests: one of each contact schedule and variant.
            progress: called with the name of each before it is compiled.

        Raises:
            CompilationError: if there is no C compiler, or it fails.
            ValueError: if the planner has no cache.
        """
        return self._stages.compile(((request, self._standing_schedule(request)) for request in requests), progress)

    def _task(self, request: MotionRequest, motion: Motion, start: Start | Estimate | None, log: SolveLog) -> _Task:
        stage = self._stages.kino_dynamic(request)
        if start is None:
            begin = Start.standing(self._stages.body)
        else:
            begin = Start.at(self.robot, start) if isinstance(start, Estimate) else start
            begin = begin.planned(self.robot)
        if request.optimize_timing and begin.sequence is not None:
            raise RefusalError(
                RefusalCode.INVALID_REQUEST,
                "the timing of a take-off whose contact sequence is given cannot be optimized",
            )
        return _Task(motion=motion, start=begin, stage=stage, log=log)

    def _schedule(self, request: MotionRequest, motion: Motion, start: Start, least_rise: float = 0.0) -> Schedule:
        dt, flight_knots = self.settings.dt, self.settings.flight_knots
        return contact_schedule(request, motion, self._stages.body, dt, flight_knots, least_rise, start.sequence)

    def _standing_schedule(self, request: MotionRequest) -> Schedule:
        return self._schedule(request, load_motion(request.motion, self.robot), Start.standing(self._stages.body))
