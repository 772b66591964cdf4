"""The actuator law, written once for planner, controller and simulator.

Torque through a gear from a voltage-limited motor with **two** constants: the torque constant k_τ [N·m/A] and the
back-EMF constant k_e [V·s/rad] (MIT Cheetah software, ``ActuatorModel.h``; thesis (3.11c) writes one k_t for both,
which doubles the speed the motor seems capable of):

    V = τ R / (k_τ g_r) + k_e g_r q̇,   |V| ≤ V_bus,   |τ| ≤ τ_max .

The rotor reflects as armature g_r² I_rotor; the gear adds viscous damping and Coulomb friction.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np


@dataclass(frozen=True, kw_only=True)
class ActuatorLaw:
    """The limits and losses of all joints of a robot; every field ``(n,)`` in joint order, joint side unless said."""

    torque_max: np.ndarray  # [N·m]
    gear_ratio: np.ndarray  # [-]
    torque_constant: np.ndarray  # k_τ, motor side [N·m/A]
    back_emf_constant: np.ndarray  # k_e, motor side [V·s/rad]
    resistance: np.ndarray  # [Ω]
    bus_voltage: np.ndarray  # [V]
    rotor_inertia: np.ndarray  # about the spin axis, motor side [kg·m²]
    damping: np.ndarray  # [N·m·s/rad]
    dry_friction: np.ndarray  # [N·m]

    def of(self, joints: np.ndarray) -> ActuatorLaw:
        """Return the law of some joints alone, given their indices."""
        return ActuatorLaw(**{field.name: getattr(self, field.name)[joints] for field in fields(self)})

    @cached_property
    def armature(self) -> np.ndarray:
        """Rotor inertia reflected to the joint, g_r² I ``(n,)`` [kg·m²]."""
        return self.gear_ratio**2 * self.rotor_inertia

    @cached_property
    def volts_per_torque(self) -> np.ndarray:
        """R / (k_τ g_r) ``(n,)`` [V/(N·m)]."""
        return self.resistance / (self.torque_constant * self.gear_ratio)

    @cached_property
    def volts_per_speed(self) -> np.ndarray:
        """k_e g_r ``(n,)`` [V·s/rad]."""
        return self.back_emf_constant * self.gear_ratio

    @cached_property
    def no_load_speed(self) -> np.ndarray:
        """Joint speed at which the bus voltage leaves no torque ``(n,)`` [rad/s]."""
        return self.bus_voltage / self.volts_per_speed

    @cached_property
    def corner_speed(self) -> np.ndarray:
        """Highest joint speed at which the full torque is available ``(n,)`` [rad/s]."""
        return (self.bus_voltage - self.torque_max * self.volts_per_torque) / self.volts_per_speed

    def voltage(self, torque: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return the motor voltage ``(..., n)`` [V] that gives ``torque`` [N·m] at joint ``speed`` [rad/s]."""
        return voltage_of(torque, speed, self.volts_per_torque, self.volts_per_speed)

    def torque_bounds(self, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the least and the greatest torque ``(..., n)`` [N·m] available at joint ``speed`` [rad/s].

        Beyond the no-load speed the interval lies wholly on the braking side, still within ±τ_max.
        """
        return torque_bounds_of(speed, self.torque_max, self.bus_voltage, self.volts_per_torque, self.volts_per_speed)

    def available(self, torque: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return the torque ``(..., n)`` [N·m] the motors deliver when ``torque`` is asked for at joint ``speed``."""
        lower, upper = self.torque_bounds(speed)
        return np.maximum(np.minimum(torque, upper), lower)

    def friction(self, speed: np.ndarray, stiction_speed: float) -> np.ndarray:
        """Return the joint torque ``(..., n)`` [N·m] that damping and dry friction take at joint ``speed`` [rad/s].

        Coulomb's sign function is smoothed to tanh(q̇ / ``stiction_speed``) so that it can be fed forward.
        """
        return friction_of(speed, self.damping, self.dry_friction, stiction_speed)

    def torque_ratio(self, torque: np.ndarray) -> np.ndarray:
        """Return |τ| / τ_max ``(..., n)``."""
        return np.abs(torque) / self.torque_max

    def voltage_ratio(self, torque: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return |V| / V_bus ``(..., n)``."""
        return np.abs(self.voltage(torque, speed)) / self.bus_voltage

    def speed_ratio(self, speed: np.ndarray) -> np.ndarray:
        """Return |q̇| / no-load speed ``(..., n)``."""
        return np.abs(speed) / self.no_load_speed


# The formulas that controllers compile as they stand.


def voltage_of(
    torque: np.ndarray, speed: np.ndarray, volts_per_torque: np.ndarray, volts_per_speed: np.ndarray
) -> np.ndarray:
    """Return the motor voltage [V] that gives ``torque`` [N·m] at joint ``speed`` [rad/s]."""
    return volts_per_torque * torque + volts_per_speed * speed


def friction_of(speed: np.ndarray, damping: np.ndarray, dry_friction: np.ndarray, stiction_speed: float) -> np.ndarray:
    """Return the joint torque [N·m] that friction takes at joint ``speed`` [rad/s], Coulomb's sign smoothed."""
    return damping * speed + dry_friction * np.tanh(speed / stiction_speed)


def torque_bounds_of(
    speed: np.ndarray,
    torque_max: np.ndarray,
    bus_voltage: np.ndarray,
    volts_per_torque: np.ndarray,
    volts_per_speed: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the greatest torque [N·m] available at joint ``speed`` [rad/s]."""
    back_emf = volts_per_speed * speed
    lower = (-bus_voltage - back_emf) / volts_per_torque
    upper = (bus_voltage - back_emf) / volts_per_torque
    least = np.maximum(np.minimum(lower, torque_max), -torque_max)
    return least, np.maximum(np.minimum(upper, torque_max), -torque_max)
