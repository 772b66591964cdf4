"""A family of optimal control problems of one robot: one per contact schedule, built at its first use and kept."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from typing import ParamSpec

from aerial_model.robot.robot import Robot
from aerial_planner.codegen.library import FunctionLibrary
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.motion.schedule import Schedule
from aerial_planner.ocp.options import SolverOptions
from aerial_planner.ocp.problem import Problem
from aerial_planner.ocp.stage import StageKind
from aerial_planner.settings import PlannerSettings

Arguments = ParamSpec("Arguments")

# Of the solver, for a guess that is nearly the optimum:
_NEAR_BARRIER = 1e-2  # barrier parameter to start at
_NEAR_BOUND_DISTANCE = 0.1  # least distance from bounds to start at


class Formulation(ABC):
    """Builds the problems of one robot, stage kind by stage kind; each kind is made once and shared by all its knots.

    Args:
        robot: the robot.
        model: its symbolic model.
        settings: discretization, margins, weights.
        options: of the solver.
        library: compiled stage functions; None: interpreted ones.
    """

    def __init__(
        self,
        robot: Robot,
        model: BaseFrameModel,
        settings: PlannerSettings,
        options: SolverOptions,
        library: FunctionLibrary | None = None,
    ) -> None:
        self.robot = robot
        self.model = model
        self.settings = settings
        self.options = options
        self.library = library
        self._problems: dict[bytes, Problem] = {}
        self._kinds: dict[Hashable, StageKind] = {}

    @abstractmethod
    def kinds(self, schedule: Schedule) -> list[StageKind]:
        """Return the stage kind of each knot."""

    def problem(self, schedule: Schedule, *, near: bool = False) -> Problem:
        """Return the problem of a schedule, built at its first use; ``near``: for guesses near the optimum."""
        key = schedule.contact.tobytes() + schedule.phase.tobytes() + bytes([schedule.flight_knots, near])
        if key not in self._problems:
            options = self.options
            if near:
                options = dataclasses.replace(
                    options, initial_barrier=_NEAR_BARRIER, bound_distance=_NEAR_BOUND_DISTANCE
                )
            self._problems[key] = Problem(self.kinds(schedule), options, self.library)
        return self._problems[key]

    def _once(
        self,
        key: Hashable,
        make: Callable[Arguments, StageKind],
        *args: Arguments.args,
        **kwargs: Arguments.kwargs,
    ) -> StageKind:
        """Return the stage kind of a key, made at its first use: knots of one kind share their expressions."""
        if key not in self._kinds:
            self._kinds[key] = make(*args, **kwargs)
        return self._kinds[key]
