"""From a motion and a goal to a checked plan."""

from typing import TYPE_CHECKING

from aerial_model.lazy import reexport

if TYPE_CHECKING:
    from aerial_planner.assembly.library import PlanLibrary
    from aerial_planner.motion.motion import Motion
    from aerial_planner.planner import Planner
    from aerial_planner.report import PlanningResult, PlanReport
    from aerial_planner.settings import PlannerSettings
else:
    __getattr__, __dir__ = reexport(
        __name__,
        {
            "assembly.library": ["PlanLibrary"],
            "motion.motion": ["Motion"],
            "planner": ["Planner"],
            "report": ["PlanReport", "PlanningResult"],
            "settings": ["PlannerSettings"],
        },
    )

__all__ = [
    "Motion",
    "PlanLibrary",
    "PlanReport",
    "Planner",
    "PlannerSettings",
    "PlanningResult",
]
