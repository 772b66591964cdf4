"""The optimal control problems: single rigid body, kino-dynamic, and the thesis's own."""

from typing import TYPE_CHECKING

from aerial_model.lazy import reexport

if TYPE_CHECKING:
    from aerial_planner.formulation.kino_dynamic import KinoDynamic
    from aerial_planner.formulation.limits import Margin, Variant
    from aerial_planner.formulation.srbm import SingleRigidBody
    from aerial_planner.formulation.thesis_literal import LiteralProblem, LiteralSolution
    from aerial_planner.formulation.trajectory import TakeOffTrajectory
    from aerial_planner.formulation.vector_layout import StageLayout, StageSymbols, VectorLayout
else:
    __getattr__, __dir__ = reexport(
        __name__,
        {
            "kino_dynamic": ["KinoDynamic"],
            "vector_layout": ["VectorLayout", "StageLayout", "StageSymbols"],
            "limits": ["Margin", "Variant"],
            "srbm": ["SingleRigidBody"],
            "thesis_literal": ["LiteralProblem", "LiteralSolution"],
            "trajectory": ["TakeOffTrajectory"],
        },
    )

__all__ = [
    "KinoDynamic",
    "LiteralProblem",
    "LiteralSolution",
    "Margin",
    "SingleRigidBody",
    "StageLayout",
    "StageSymbols",
    "TakeOffTrajectory",
    "Variant",
    "VectorLayout",
]
