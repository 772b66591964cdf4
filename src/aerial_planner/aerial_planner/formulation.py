"""What the planner's optimization stages share: one problem per contact schedule, built at its first use and kept."""

from __future__ import annotations

from abc import ABC, abstractmethod

from aerial_model.robot import Robot
from aerial_planner.compiled import FunctionLibrary
from aerial_planner.schedule import Schedule
from aerial_planner.settings import PlannerSettings
from aerial_planner.stage import StageKind
from aerial_planner.symbolic import BaseFrameModel
from aerial_planner.transcription import Problem, SolverOptions


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

    def problem(self, schedule: Schedule) -> Problem:
        """Return the problem of a schedule, built at its first use."""
        key = schedule.contact.tobytes() + schedule.phase.tobytes() + bytes([schedule.flight_knots])
        if key not in self._problems:
            self._problems[key] = Problem(self.kinds(schedule), self.options, self.library)
        return self._problems[key]
