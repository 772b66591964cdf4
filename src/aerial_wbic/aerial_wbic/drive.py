"""From accelerations and forces to what the motor boards are told, and the count of what they cannot give."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.actuator import ActuatorLaw
from aerial_model.compiled import compiled, friction_of, torque_bounds_of, voltage_of
from aerial_model.kinematics import Configuration
from aerial_model.robot import JOINT_VELOCITY, Robot
from aerial_model.state import Command, Measurement
from aerial_wbic.gains import ControllerGains
from aerial_wbic.qp import Room, Solution, inverse_dynamics
from aerial_wbic.target import PostureTarget


class _Law(NamedTuple):
    """The actuator law's arrays ``(n,)`` that a tick needs, and the width of the friction's sign change [rad/s]."""

    torque_max: np.ndarray
    bus_voltage: np.ndarray
    volts_per_torque: np.ndarray
    volts_per_speed: np.ndarray
    damping: np.ndarray
    dry_friction: np.ndarray
    stiction_speed: float

    @classmethod
    def of(cls, law: ActuatorLaw, stiction_speed: float) -> _Law:
        return cls(*(np.array(getattr(law, name)) for name in cls._fields[:-1]), stiction_speed)


class Drive:
    """Inverse dynamics, friction feed-forward and limits.

    A command asks for what the motion needs, also beyond a limit: the boards limit it by the same actuator law, and
    ``saturated_ticks`` tells how often.
    """

    def __init__(self, robot: Robot, gains: ControllerGains) -> None:
        self._law = _Law.of(robot.actuators, gains.stiction_speed)
        self._arms = robot.arms
        n = robot.n_joints
        self._zeros = np.zeros(n)
        self._share = gains.actuator_share
        self._joint_damping = np.full(n, gains.joint_damping)
        self._posture_stiffness = np.full(n, gains.posture_stiffness)
        self._stop_damping = np.full(n, gains.stop_damping)
        self.saturated_ticks = 0

    def command(self, state: Configuration, solution: Solution, v_ref: np.ndarray, measurement: Measurement) -> Command:
        """Return the command for an acceleration and forces that obey the base's equations of motion.

        τ = joint rows of H q̈ + C q̇ + G − J_cᵀ f_r, plus the friction of the joints moving at q̇_ref. Damping about
        q̇_ref rides along. Whatever happened before, a command is finite: else the joints are only damped.

        Args:
            state: of the robot.
            solution: q̈ and f_r.
            v_ref: q̇_ref ``(nv,)``; of the tasks, not measured, so that friction is overcome also from rest.
            measurement: that is answered.
        """
        velocity = v_ref[JOINT_VELOCITY]
        torque, saturated = _torque(
            state,
            solution,
            velocity,
            measurement.joint_velocity,
            self._joint_damping,
            self._share,
            self._arms,
            self._law,
        )
        if saturated < 0:
            return self.resting(None, measurement)
        self.saturated_ticks += saturated
        return Command(
            torque=torque,
            position=measurement.joint_position,
            velocity=velocity,
            stiffness=self._zeros,
            damping=self._joint_damping,
            state_time=measurement.time,
            state_sequence=measurement.sequence,
        )

    def room(self, v_ref: np.ndarray, measurement: Measurement) -> Room:
        """Return the torques that inverse dynamics may ask for, given what friction and damping take of the limits.

        Args:
            v_ref: q̇_ref ``(nv,)``.
            measurement: that is answered.
        """
        return _room(v_ref[JOINT_VELOCITY], measurement.joint_velocity, self._joint_damping, self._share, self._law)

    def resting(self, posture: PostureTarget | None, measurement: Measurement) -> Command:
        """Return the command of a robot that does not stand: joints go to a posture, or only resist motion."""
        return Command(
            torque=self._zeros,
            position=measurement.joint_position if posture is None else posture.joint_position,
            velocity=self._zeros if posture is None else posture.joint_velocity,
            stiffness=self._zeros if posture is None else self._posture_stiffness,
            damping=self._stop_damping,
            state_time=measurement.time,
            state_sequence=measurement.sequence,
        )


@compiled
def _room(
    velocity: np.ndarray, measured_velocity: np.ndarray, joint_damping: np.ndarray, share: float, law: _Law
) -> Room:
    """Return the torques that keep a ``share`` of the limits, less what rides along with them."""
    least, greatest = torque_bounds_of(
        measured_velocity,
        share * law.torque_max,
        share * law.bus_voltage,
        law.volts_per_torque,
        law.volts_per_speed,
    )
    along = friction_of(velocity, law.damping, law.dry_friction, law.stiction_speed)
    along += joint_damping * (velocity - measured_velocity)
    return Room(least - along, greatest - along)


@compiled
def _torque(
    state: Configuration,
    solution: Solution,
    velocity: np.ndarray,
    measured_velocity: np.ndarray,
    joint_damping: np.ndarray,
    share: float,
    arms: np.ndarray,
    law: _Law,
) -> tuple[np.ndarray, int]:
    """Return the feed-forward torques ``(n,)`` [N·m], and whether the boards will be asked for too much: 1, 0.

    It is −1 if a torque is not finite. Arms, which bear nothing, are asked for no more than a ``share`` of the limits.
    """
    torque = inverse_dynamics(state, solution)
    if len(arms) > 0:
        room = _room(velocity, measured_velocity, joint_damping, share, law)
        for j in arms:
            torque[j] = min(max(torque[j], room.least[j]), room.greatest[j])
    torque += friction_of(velocity, law.damping, law.dry_friction, law.stiction_speed)
    requested = torque + joint_damping * (velocity - measured_velocity)
    voltage = voltage_of(requested, measured_velocity, law.volts_per_torque, law.volts_per_speed)
    saturated = 0
    for j in range(len(torque)):
        if not np.isfinite(torque[j]):
            return torque, -1
        if abs(requested[j]) > law.torque_max[j] or abs(voltage[j]) > law.bus_voltage[j]:
            saturated = 1
    return torque, saturated
