"""The motor boards: set-point with gains in, torque out, limited by the actuator law at every physics step."""

from __future__ import annotations

import numpy as np

from aerial_model.actuator import ActuatorLaw
from aerial_model.state import Command


class Drive:
    """All drives of a robot, with the record of one control period.

    Args:
        law: limits of the motors.
        steps: physics steps in a control period.
    """

    def __init__(self, law: ActuatorLaw, steps: int) -> None:
        self._law = law
        shape = (steps, len(law.torque_max))
        self._requested = np.zeros(shape)  # [N·m]
        self._delivered = np.zeros(shape)  # [N·m]
        self._speed = np.zeros(shape)  # [rad/s]

    def clear(self) -> None:
        """Forget the period."""
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
        delivered = self._law.available(requested, speed)
        self._requested[step] = requested
        self._delivered[step] = delivered
        self._speed[step] = speed
        return delivered

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
