"""The formulas of the actuator law, compiled for use inside compiled code."""

from __future__ import annotations

from aerial_model.numerics.jit import compiled
from aerial_model.robot import actuator

friction_of = compiled(actuator.friction_of)
voltage_of = compiled(actuator.voltage_of)
torque_bounds_of = compiled(actuator.torque_bounds_of)
