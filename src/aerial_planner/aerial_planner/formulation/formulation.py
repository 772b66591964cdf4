"""What the planner's optimization stages share: one problem per contact schedule, built at its first use and kept."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod

from aerial_model.robot.robot import Robot
from aerial_planner.codegen.library import FunctionLibrary
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.motion.schedule import Schedule
from aerial_planner.ocp.options import SolverOptions
from aerial_planner.ocp.problem import Problem
from aerial_planner.ocp.stage import StageKind
from aerial_planner.settings import PlannerSettings

_NEAR = {"initial_barrier": 1e-2, "bound_distance": 0.1}  # SolverOptions for a guess that is nearly the optimum


class Formulation(ABC):
    """A family of problems of one robot.

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
        self._kinds: dict[tuple, StageKind] = {}

    @abstractmethod
    def kinds(self, schedule: Schedule) -> list[StageKind]:
        """Return the stage kind of each knot."""

    def problem(self, schedule: Schedule, *, near: bool = False) -> Problem:
        """Return the problem of a schedule, built at its first use; ``near``: for guesses near the optimum."""
        key = schedule.contact.tobytes() + schedule.phase.tobytes() + bytes([schedule.flight_knots, near])
        if key not in self._problems:
            options = dataclasses.replace(self.options, **_NEAR) if near else self.options
            self._problems[key] = Problem(self.kinds(schedule), options, self.library)
        return self._problems[key]
