"""From an optimized take-off to a checked plan: assembly, exact torques, collisions, stored plans."""

from aerial_planner.assembly.actuator_use import ActuatorUse, actuator_use
from aerial_planner.assembly.assemble import assemble
from aerial_planner.assembly.collision import CollisionModel, Touch
from aerial_planner.assembly.library import PlanLibrary
from aerial_planner.assembly.touchdown import landing_position

__all__ = [
    "ActuatorUse",
    "CollisionModel",
    "PlanLibrary",
    "Touch",
    "actuator_use",
    "assemble",
    "landing_position",
]
