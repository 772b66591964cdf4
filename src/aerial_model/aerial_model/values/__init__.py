"""The values that planner, controller, simulator and operator exchange."""

from aerial_model.values.command import Command
from aerial_model.values.contact_sequence import ContactPhase, ContactSequence
from aerial_model.values.estimate import Estimate
from aerial_model.values.frame import StartFrame
from aerial_model.values.measurement import Measurement
from aerial_model.values.plan import Plan
from aerial_model.values.request import ControllerCommand, MotionRequest
from aerial_model.values.terrain import Box, Terrain

__all__ = [
    "Box",
    "Command",
    "ContactPhase",
    "ContactSequence",
    "ControllerCommand",
    "Estimate",
    "Measurement",
    "MotionRequest",
    "Plan",
    "StartFrame",
    "Terrain",
]
