"""The motor boards: set-point with gains in, torque out, limited by the actuator law at every physics step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.numerics.jit import compiled
from aerial_model.robot.actuator import ActuatorLaw
from aerial_model.robot.compiled_actuator import torque_bounds_of, voltage_of
from aerial_model.values.command import Command


class _Law(NamedTuple):
    """What the motor boards need of the actuator law, arrays ``(n,)``, and of the battery."""

    torque_max: np.ndarray
    bus_voltage: np.ndarray
    volts_per_torque: np.ndarray
    volts_per_speed: np.ndarray
    amperes_per_torque: np.ndarray  # of the motor [A/(N·m)]
    battery_resistance: float  # [Ω]


class _Period(NamedTuple):
    """The record of one control period."""

    requested: np.ndarray  # (n,) sum over the physics steps so far [N·m]
    delivered: np.ndarray  # (n,) sum of what the motors gave [N·m]
    peaks: np.ndarray  # (2,) largest ratios of requested torque and of the voltage it needs
    current: np.ndarray  # (1,) drawn from the battery in the last physics step [A]


class MotorBoards:
    """All motor boards of a robot, with the record of one control period.

    Args:
        law: limits of the motors.
        steps: physics steps in a control period.
        battery_resistance: by which the bus voltage sags under load [Ω].
    """

    def __init__(self, law: ActuatorLaw, steps: int, battery_resistance: float = 0.0) -> None:
        n = len(law.torque_max)
        self._law = _Law(
            torque_max=np.array(law.torque_max, dtype=float),
            bus_voltage=np.array(law.bus_voltage, dtype=float),
            volts_per_torque=np.array(law.volts_per_torque, dtype=float),
            volts_per_speed=np.array(law.volts_per_speed, dtype=float),
            amperes_per_torque=1.0 / (law.torque_constant * law.gear_ratio),
            battery_resistance=float(battery_resistance),
        )
        self._steps = steps
        self._period = _Period(np.zeros(n), np.zeros(n), np.zeros(2), np.zeros(1))
        zero = np.zeros(n)
        nothing = Command(torque=zero, position=zero, velocity=zero, stiffness=zero, damping=zero)
        self.torque(0, nothing, np.zeros(n), np.zeros(n))  # compiles what no tick may
        self.clear()

    def clear(self) -> None:
        """Forget the period."""
        for record in self._period:
            record[:] = 0.0

    def torque(self, step: int, command: Command, position: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return the torque ``(n,)`` [N·m] delivered in physics step number ``step`` of the period.

        Args:
            step: counted from 0, with which a period begins.
            command: set-points that hold for the period.
            position: joint positions ``(n,)`` [rad].
            speed: joint velocities ``(n,)`` [rad/s].

        Raises:
            ValueError: if the command does not amount to finite torques.
        """
        set_points = command.torque, command.position, command.velocity, command.stiffness, command.damping
        delivered, finite = _deliver(step, set_points, position, speed, self._law, self._period)
        if step == 0 and not finite:
            requested = command.requested_torque(position, speed)
            raise ValueError(f"a command must ask for finite torques, found {requested}")
        return delivered

    @property
    def requested_torque(self) -> np.ndarray:
        """Mean over the period of what was asked for, before any limit ``(n,)`` [N·m]."""
        return self._period.requested / self._steps

    @property
    def delivered_torque(self) -> np.ndarray:
        """Mean over the period of what the motors gave ``(n,)`` [N·m]."""
        return self._period.delivered / self._steps

    @property
    def peak_torque_ratio(self) -> float:
        """Largest requested torque over its limit, over joints and physics steps."""
        return float(self._period.peaks[0])

    @property
    def peak_voltage_ratio(self) -> float:
        """Largest voltage the requested torque needs over the bus voltage, over joints and physics steps."""
        return float(self._period.peaks[1])


@compiled
def _deliver(
    step: int, set_points: tuple[np.ndarray, ...], position: np.ndarray, speed: np.ndarray, law: _Law, period: _Period
) -> tuple[np.ndarray, bool]:
    """Return the torque ``(n,)`` of one physics step, added to the period's record, and whether all of it is finite.

    The battery's voltage is down by what the last step's current cost.
    """
    torque, position_set, speed_set, stiffness, damping = set_points
    if step == 0:
        period.requested[:] = 0.0
        period.delivered[:] = 0.0
        period.peaks[:] = 0.0
    delivered = np.empty(len(torque))
    finite = True
    power = 0.0
    for j in range(len(torque)):
        requested = torque[j] + stiffness[j] * (position_set[j] - position[j]) + damping[j] * (speed_set[j] - speed[j])
        finite &= np.isfinite(requested)
        bus_voltage = max(law.bus_voltage[j] - law.battery_resistance * period.current[0], 0.0)
        least, most = torque_bounds_of(
            speed[j], law.torque_max[j], bus_voltage, law.volts_per_torque[j], law.volts_per_speed[j]
        )
        delivered[j] = max(min(requested, most), least)
        voltage = voltage_of(delivered[j], speed[j], law.volts_per_torque[j], law.volts_per_speed[j])
        power += voltage * delivered[j] * law.amperes_per_torque[j]
        needed = voltage_of(requested, speed[j], law.volts_per_torque[j], law.volts_per_speed[j])
        period.requested[j] += requested
        period.delivered[j] += delivered[j]
        period.peaks[0] = max(period.peaks[0], abs(requested) / law.torque_max[j])
        period.peaks[1] = max(period.peaks[1], abs(needed) / law.bus_voltage[j])
    period.current[0] = max(power, 0.0) / law.bus_voltage.mean()
    return delivered, finite
