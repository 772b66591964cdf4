"""Motors of a draft: constants, in the proportions of the Mini Cheetah's, that give the limits of the URDF."""

from __future__ import annotations

from dataclasses import dataclass

from aerial_model.robot.draft.mechanism import Mechanism

BUS_VOLTAGE = 48.0  # [V]
GEAR_RATIO = 6.0
_RESISTIVE = 0.3  # share of the voltage that full torque takes: it is there up to 70 % of the no-load speed
_CONSTANTS = 0.75  # torque constant over back-EMF constant
_ARMATURE = 6e-6  # reflected rotor inertia over the square of the greatest torque [kg·m²/(N·m)²]
_DAMPING, _FRICTION = 6e-4, 0.01  # over the greatest torque [s/rad], [-]
_USUAL_TORQUE = 4.0  # N·m per kg of robot and metre of leg, where the URDF has no limit
_IMPLAUSIBLE = 20.0  # times the usual torque
_USUAL_SPEED = 25.0  # [rad/s], where the URDF has no limit
_IMPLAUSIBLE_SPEED = 1e3  # [rad/s]


@dataclass(frozen=True, kw_only=True)
class MotorKind:
    """A motor with the limits of all joints that it moves; constants are of the motor, before the gear."""

    joints: tuple[str, ...]
    torque: float  # greatest, of the joint [N·m]
    speed: float  # without load, of the joint [rad/s]
    damping: float  # [N·m·s/rad]
    friction: float  # [N·m]

    @property
    def back_emf_constant(self) -> float:
        """Volts that the no-load speed takes are the bus's [V·s/rad]."""
        return BUS_VOLTAGE / (GEAR_RATIO * self.speed)

    @property
    def torque_constant(self) -> float:
        """Torque of a current, in the proportion of the Mini Cheetah's motors [N·m/A]."""
        return _CONSTANTS * self.back_emf_constant

    @property
    def resistance(self) -> float:
        """Resistance at which full torque is there up to 70 % of the no-load speed [Ω]."""
        return _RESISTIVE * BUS_VOLTAGE * GEAR_RATIO * self.torque_constant / self.torque

    @property
    def rotor_inertia(self) -> float:
        """Inertia of the rotor, which grows with the square of the torque [kg·m²]."""
        return _ARMATURE * self.torque**2 / GEAR_RATIO**2


def motor_kinds(mechanism: Mechanism, leg_length: float) -> tuple[tuple[MotorKind, ...], list[str]]:
    """Return one kind of motor for all joints with the same limits, and what had to be guessed.

    Args:
        mechanism: the robot.
        leg_length: from the base to the ground [m]: with the mass, it says what torques are usual.
    """
    model, names = mechanism.model, mechanism.joint_names
    usual = _USUAL_TORQUE * mechanism.mass * leg_length
    guesses: list[str] = []
    groups: dict[tuple[float, float, float, float], list[str]] = {}
    for j, name in enumerate(names):
        torque, speed = float(model.effortLimit[6 + j]), float(model.velocityLimit[6 + j])
        if not 0 < torque < _IMPLAUSIBLE * usual:
            text = f"{name}: {torque:g} N·m in the URDF is no motor's limit"
            guesses.append(f"{text}; {usual:.1f} N·m from mass and leg length")
            torque = usual
        if not 0 < speed < _IMPLAUSIBLE_SPEED:
            guesses.append(f"{name}: no speed limit in the URDF; {_USUAL_SPEED:.0f} rad/s")
            speed = _USUAL_SPEED
        damping = float(model.damping[6 + j]) or _DAMPING * torque
        friction = float(model.friction[6 + j]) or _FRICTION * torque
        groups.setdefault((round(torque, 4), round(speed, 4), damping, friction), []).append(name)
    kinds = tuple(
        MotorKind(joints=tuple(joints), torque=torque, speed=speed, damping=damping, friction=friction)
        for (torque, speed, damping, friction), joints in groups.items()
    )
    return kinds, guesses
