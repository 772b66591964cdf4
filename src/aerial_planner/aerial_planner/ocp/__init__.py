"""A solver for multi-stage optimal control problems, which knows no robot; see README.md in this folder."""

from typing import TYPE_CHECKING

from aerial_model.lazy import reexport

if TYPE_CHECKING:
    from aerial_planner.ocp.options import SolverName, SolverOptions
    from aerial_planner.ocp.problem import Problem, Solution
    from aerial_planner.ocp.stage import Rows, StageData, StageKind
else:
    __getattr__, __dir__ = reexport(
        __name__,
        {
            "options": ["SolverName", "SolverOptions"],
            "problem": ["Problem", "Solution"],
            "stage": ["Rows", "StageData", "StageKind"],
        },
    )

__all__ = [
    "Problem",
    "Rows",
    "Solution",
    "SolverName",
    "SolverOptions",
    "StageData",
    "StageKind",
]
