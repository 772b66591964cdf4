"""The optimization stages of one robot, whose problems are built once per contact schedule and reused."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from pathlib import Path

from aerial_model.errors import ConfigurationError, RefusalCode, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.assembly import flight
from aerial_planner.codegen.batch import no_machine_code
from aerial_planner.codegen.library import FunctionLibrary
from aerial_planner.formulation.kino_dynamic import KinoDynamic
from aerial_planner.formulation.limits import Variant
from aerial_planner.formulation.srbm import SingleRigidBody
from aerial_planner.kinematics.base_frame import base_frame_model
from aerial_planner.kinematics.inverse_kinematics import InverseKinematics
from aerial_planner.motion.schedule import Schedule
from aerial_planner.ocp import interior_point
from aerial_planner.ocp.options import SolverName, SolverOptions
from aerial_planner.ocp.stage import StageKind
from aerial_planner.settings import PlannerSettings

_TOLERANCE = 3e-4  # of the optimum: tighter ones cost two iterations and gain a hundred-thousandth of the cost
_BARRIER_ACCURACY = 300.0  # of our own solver: a tenth fewer iterations of rolls and flips than with the others' 100
_ITERATIONS_MAX = 50  # of one solve: those that succeed take 10 to 40


class Stages:
    """Single rigid body and kino-dynamic stage of one robot, and the functions they evaluate.

    Args:
        robot: the whole robot.
        settings: of the planner.
        solver: one of ``SolverName``.
        cache: folder of compiled functions; None: evaluate interpreted ones.

    Raises:
        ConfigurationError: if there is no such solver.
    """

    def __init__(self, robot: Robot, settings: PlannerSettings, solver: str, cache: Path | None) -> None:
        self.settings = settings
        self.body = robot.planned
        self.options = _solver_options(solver)
        self._robot = robot
        self._library = FunctionLibrary(cache) if cache else None
        machine_code = self._library.load_function if self._library else no_machine_code
        self.model = base_frame_model(self.body, machine_code)
        interior_point.rehearse()
        flight.rehearse()
        self.ik = InverseKinematics(self.body, self.model, machine_code)
        self._batches = (*self.model.batches, self.ik.feet)
        for batch in self._batches:
            batch.memory(1)  # which looks for machine code
        self.srbm = SingleRigidBody(self.body, self.model, self.ik, settings, self.options, self._library)
        self._kino_dynamic: dict[tuple[Variant, bool], KinoDynamic] = {}

    def kino_dynamic(self, request: MotionRequest) -> KinoDynamic:
        """Return the kino-dynamic stage of the request's variant, with or without the timing optimized.

        Raises:
            RefusalError: if there is no such variant.
        """
        key = _variant(request), request.optimize_timing
        if key not in self._kino_dynamic:
            self._kino_dynamic[key] = KinoDynamic(
                self._robot, self.model, self.settings, key[0], self.options, self._library, timed=key[1]
            )
        return self._kino_dynamic[key]

    def build(self, request: MotionRequest, schedule: Schedule, *, near: bool) -> None:
        """Build the problems of a request's schedule; ``near``: those that start from a stored plan, too."""
        self.srbm.problem(schedule, near=True)
        self.kino_dynamic(request).problem(schedule)
        if near:
            self.kino_dynamic(request).problem(schedule, near=True)

    def compile(self, cases: Iterable[tuple[MotionRequest, Schedule]], progress: Callable[[str], None]) -> int:
        """Compile what plans of these requests evaluate, unless it is there; return how many libraries that were.

        Args:
            cases: a request of each contact schedule and variant, and its schedule.
            progress: called with the name of each before it is compiled.

        Raises:
            CompilationError: if there is no C compiler, or it fails.
            ValueError: if there is no cache.
        """
        if self._library is None:
            raise ValueError("a planner without a cache has nowhere to compile to")
        kinds: dict[str, StageKind] = {}
        for request, schedule in cases:
            for stage in (self.srbm, self.kino_dynamic(request)):
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


def _solver_options(solver: str) -> SolverOptions:
    if solver not in list(SolverName):
        raise ConfigurationError(f"solver: expected one of {', '.join(SolverName)}, found '{solver}'")
    options = SolverOptions(solver=SolverName(solver), tolerance=_TOLERANCE, max_iterations=_ITERATIONS_MAX)
    if solver == SolverName.RICCATI:
        return dataclasses.replace(options, barrier_accuracy=_BARRIER_ACCURACY)
    return options


def _variant(request: MotionRequest) -> Variant:
    try:
        return Variant(request.variant or Variant.AAKD_STAR)
    except ValueError:
        known = ", ".join(Variant)
        raise RefusalError(
            RefusalCode.INVALID_REQUEST, f"unknown variant '{request.variant}'; known: {known}"
        ) from None
