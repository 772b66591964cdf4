"""What planning a request took, and what came of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from aerial_model.errors import RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Plan
from aerial_model.values.request import MotionRequest
from aerial_planner.assembly.actuator_use import ActuatorUse
from aerial_planner.assembly.touchdown import landing_position
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.ocp.problem import Solution

Progress = Callable[[str, int, float], None]  # stage, iterations so far, residual
Solved = tuple[TakeOffTrajectory, Solution]


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
    cost: float | None = None
    max_violation: float | None = None
    peak_torque_ratio: float | None = None
    peak_voltage_ratio: float | None = None
    peak_speed_ratio: float | None = None
    take_off_time_s: float | None = None
    flight_time_s: float | None = None
    rotation_deg: list[float] | None = None
    landing_position_m: list[float] | None = None
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


class SolveLog:
    """Sums time and iterations of the solves of one request, tells a listener of each, and reports in the end.

    Args:
        request: that is planned.
        robot: the whole robot.
        solver: name of the solver.
        progress: called after each solve; None: nobody listens.
    """

    def __init__(self, request: MotionRequest, robot: Robot, solver: str, progress: Progress | None = None) -> None:
        self.iterations = 0
        self.started_from = ""  # where the last solve of the kino-dynamic stage began
        self._request, self._robot, self._solver, self._listener = request, robot, solver, progress
        self._began = time.perf_counter()
        self._seconds = {"srbm": 0.0, "kino_dynamic": 0.0}

    def timed(self, stage: str, solve: Callable[[], Solved]) -> Solved:
        """Return the result of a solve of ``stage``: srbm or kino_dynamic."""
        began = time.perf_counter()
        solved = solve()
        self._seconds[stage] += time.perf_counter() - began
        _, solution = solved
        self.iterations += solution.iterations
        self.progress(stage, solution)
        return solved

    def progress(self, stage: str, solution: Solution) -> None:
        """Tell the listener how far the request is."""
        if self._listener is not None:
            self._listener(stage, self.iterations, solution.max_violation)

    def success(self, plan: Plan, solution: Solution, use: ActuatorUse) -> PlanReport:
        """Return the report of a checked plan."""
        return self._report(
            success=True,
            cost=solution.cost,
            max_violation=solution.max_violation,
            peak_torque_ratio=float(use.torque_ratio.max()),
            peak_voltage_ratio=float(use.voltage_ratio.max()),
            peak_speed_ratio=float(use.speed_ratio.max()),
            take_off_time_s=plan.take_off_time,
            flight_time_s=plan.landing_time - plan.take_off_time,
            rotation_deg=np.rad2deg(plan.rotation).tolist(),
            landing_position_m=landing_position(plan, self._robot).tolist(),
        )

    def failure(self, refusal: RefusalError) -> PlanReport:
        """Return the report of a request that was refused."""
        return self._report(success=False, refusal={"code": refusal.code.value, "reason": refusal.reason})

    def _report(self, **figures: Any) -> PlanReport:
        return PlanReport(
            motion=self._request.motion,
            robot=self._robot.name,
            variant=self._request.variant,
            warm_start=self._request.warm_start,
            optimize_timing=self._request.optimize_timing,
            started_from=self.started_from,
            solver=self._solver,
            total_time_s=time.perf_counter() - self._began,
            solve_time_s=self._seconds["kino_dynamic"],
            srbm_time_s=self._seconds["srbm"],
            iterations=self.iterations,
            **figures,
        )
