"""The motor boards: set-point with gains in, torque out, limited by the actuator law at every physics step."""

from __future__ import annotations

import dataclasses

import numpy as np

from aerial_model.actuator import ActuatorLaw
from aerial_model.state import Command


class Drive:
    """All drives of a robot, with the record of one control period.

    Args:
        law: limits of the motors.
        steps: physics steps in a control period.
        battery_resistance: by which the bus voltage sags under load [Ω].
    """

    def __init__(self, law: ActuatorLaw, steps: int, battery_resistance: float = 0.0) -> None:
        self._law = law
        self._battery_resistance = battery_resistance
        self._current = 0.0  # drawn from the battery in the last physics step [A]
        shape = (steps, len(law.torque_max))
        self._requested = np.zeros(shape)  # [N·m]
        self._delivered = np.zeros(shape)  # [N·m]
        self._speed = np.zeros(shape)  # [rad/s]

    def clear(self) -> None:
        """Forget the period."""
        self._current = 0.0
        for record in (self._requested, self._delivered, self._speed):
            record[:] = 0.0

    def torque(self, step: int, command: Command, position: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return the torque ``(n,)`` [N·m] delivered in physics step number ``step`` of the period.

        Args:
            step: counted from 0.
            command: set-points that hold for the period.
            position: joint positions ``(n,)`` [rad].
            speed: joint velocities ``(n,)`` [rad/s].

        Raises:
            ValueError: if the command does not amount to finite torques.
        """
        requested = command.requested_torque(position, speed)
        if step == 0 and not np.isfinite(requested).all():
            raise ValueError(f"a command must ask for finite torques, found {requested}")
        law = self._sagging_law() if self._battery_resistance else self._law
        delivered = law.available(requested, speed)
        if self._battery_resistance:
            power = law.voltage(delivered, speed) @ (delivered / (law.torque_constant * law.gear_ratio))
            self._current = max(float(power), 0.0) / float(self._law.bus_voltage.mean())
        self._requested[step] = requested
        self._delivered[step] = delivered
        self._speed[step] = speed
        return delivered

    def _sagging_law(self) -> ActuatorLaw:
        voltage = self._law.bus_voltage - self._battery_resistance * self._current
        return dataclasses.replace(self._law, bus_voltage=np.maximum(voltage, 0.0))

    @property
    def requested_torque(self) -> np.ndarray:
        """Mean over the period of what was asked for, before any limit ``(n,)`` [N·m]."""
        return self._requested.mean(axis=0)

    @property
    def delivered_torque(self) -> np.ndarray:
        """Mean over the period of what the motors gave ``(n,)`` [N·m]."""
        return self._delivered.mean(axis=0)

    @property
    def peak_torque_ratio(self) -> float:
        """Largest requested torque over its limit, over joints and physics steps."""
        return float(self._law.torque_ratio(self._requested).max())

    @property
    def peak_voltage_ratio(self) -> float:
        """Largest voltage the requested torque needs over the bus voltage, over joints and physics steps."""
        return float(self._law.voltage_ratio(self._requested, self._speed).max())
