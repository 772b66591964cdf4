"""From joint torques to measurements: the robot and its world in MuJoCo."""

from typing import TYPE_CHECKING

from aerial_model.lazy import reexport

if TYPE_CHECKING:
    from aerial_sim.conditions import Conditions
    from aerial_sim.simulation import Simulation
else:
    __getattr__, __dir__ = reexport(
        __name__,
        {
            "conditions": ["Conditions"],
            "simulation": ["Simulation"],
        },
    )

__all__ = [
    "Conditions",
    "Simulation",
]
