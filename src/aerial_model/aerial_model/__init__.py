"""The robot as data, and the values exchanged about it: what every other package speaks in."""

from typing import TYPE_CHECKING

from aerial_model.lazy import reexport

if TYPE_CHECKING:
    from aerial_model.errors import (
        AerialError,
        ConfigurationError,
        InvalidPlanError,
        NumericsError,
        RefusalCode,
        RefusalError,
    )
    from aerial_model.robot.robot import Robot
    from aerial_model.values.command import Command
    from aerial_model.values.contact_sequence import ContactPhase, ContactSequence
    from aerial_model.values.estimate import Estimate
    from aerial_model.values.frame import StartFrame
    from aerial_model.values.measurement import Measurement
    from aerial_model.values.plan import Plan
    from aerial_model.values.request import MotionRequest
    from aerial_model.values.terrain import Box, Terrain
else:
    __getattr__, __dir__ = reexport(
        __name__,
        {
            "errors": [
                "AerialError",
                "ConfigurationError",
                "InvalidPlanError",
                "NumericsError",
                "RefusalCode",
                "RefusalError",
            ],
            "robot.robot": ["Robot"],
            "values.command": ["Command"],
            "values.contact_sequence": ["ContactPhase", "ContactSequence"],
            "values.estimate": ["Estimate"],
            "values.frame": ["StartFrame"],
            "values.measurement": ["Measurement"],
            "values.plan": ["Plan"],
            "values.request": ["MotionRequest"],
            "values.terrain": ["Box", "Terrain"],
        },
    )

__version__ = "0.1.0"  # of the project; tests/conventions holds the manifests and the changelog to it

__all__ = [
    "AerialError",
    "Box",
    "Command",
    "ConfigurationError",
    "ContactPhase",
    "ContactSequence",
    "Estimate",
    "InvalidPlanError",
    "Measurement",
    "MotionRequest",
    "NumericsError",
    "Plan",
    "RefusalCode",
    "RefusalError",
    "Robot",
    "StartFrame",
    "Terrain",
]
