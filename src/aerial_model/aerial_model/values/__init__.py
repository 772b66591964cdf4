"""The values that planner, controller, simulator and operator exchange."""

from aerial_model.values.command import Command
from aerial_model.values.estimate import Estimate
from aerial_model.values.measurement import Measurement
from aerial_model.values.plan import Plan
from aerial_model.values.request import ControllerCommand, MotionRequest
from aerial_model.values.terrain import Box, Terrain

__all__ = ["Box", "Command", "ControllerCommand", "Estimate", "Measurement", "MotionRequest", "Plan", "Terrain"]
