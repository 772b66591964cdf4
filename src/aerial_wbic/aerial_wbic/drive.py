"""From accelerations and forces to what the motor boards are told, and the count of what they cannot give."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.actuator import ActuatorLaw
from aerial_model.compiled import compiled, friction_of, torque_bounds_of, voltage_of
from aerial_model.kinematics import Kinematics
from aerial_model.robot import JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_model.state import Command, Measurement
from aerial_wbic.gains import ControllerGains
from aerial_wbic.qp import Room
from aerial_wbic.target import PostureTarget

_FASTEST = 500.0  # [1/s] at which damping may stop a joint by itself: faster, boards that sample would shake it
_TO_STOP = 0.01  # [s] in which no joint is to reach its stop


class _Law(NamedTuple):
    """What a tick needs of the actuator law, arrays ``(n,)``, and of the gains."""

    torque_max: np.ndarray
    bus_voltage: np.ndarray
    volts_per_torque: np.ndarray
    volts_per_speed: np.ndarray
    damping: np.ndarray
    dry_friction: np.ndarray
    joint_damping: np.ndarray  # [N·m·s/rad]
    stiction_speed: float  # [rad/s]
    share: float  # of the limits that may be asked for

    @classmethod
    def of(cls, law: ActuatorLaw, gains: ControllerGains, lightness: np.ndarray) -> _Law:
        arrays = [np.array(getattr(law, name)) for name in cls._fields[:6]]
        damping = gains.joint_damping * lightness
        return cls(*arrays, damping, gains.stiction_speed, gains.actuator_share)


class Drive:
    """Friction feed-forward and limits.

    A command asks for what the motion needs, also beyond a limit: the boards limit it by the same actuator law, and
    ``saturated_ticks`` tells how often.
    """

    def __init__(self, robot: Robot, gains: ControllerGains) -> None:
        lightness = _lightness(robot, gains.joint_damping)
        self._law = _Law.of(robot.actuators, gains, lightness)
        self._arms = robot.arms
        self._legs = np.setdiff1d(np.arange(robot.n_joints), robot.arms)
        n = robot.n_joints
        model = robot.model
        self._stops = model.lowerPositionLimit[JOINT_POSITION].copy(), model.upperPositionLimit[JOINT_POSITION].copy()
        self._zeros = np.zeros(n)
        self._posture_stiffness = gains.posture_stiffness * lightness
        self._stop_damping = gains.stop_damping * lightness
        self.saturated_ticks = 0

    def off_stops(self, v_ref: np.ndarray, measurement: Measurement) -> None:
        """Take from q̇_ref ``(nv,)`` what would run joints into their stops: there is no going on, only torque in vain."""
        _off_stops(v_ref[JOINT_VELOCITY], measurement.joint_position, *self._stops)

    def exceeds(self, torque: np.ndarray, v_ref: np.ndarray, measurement: Measurement) -> bool:
        """Return whether a torque ``(n,)`` [N·m] of a joint that can bear load leaves its room; the rest as for ``room``."""
        return _exceeds(torque, v_ref[JOINT_VELOCITY], measurement.joint_velocity, self._legs, self._law)

    def command(self, torque: np.ndarray, v_ref: np.ndarray, measurement: Measurement) -> Command:
        """Return the command for the torques that the equations of motion ask for.

        To them it adds the friction of the joints moving at q̇_ref. Damping about q̇_ref rides along. Arms, which bear
        nothing, are asked for no more than they have room for. Whatever happened before, a command is finite: else the
        joints are only damped.

        Args:
            torque: of the joints ``(n,)`` [N·m].
            v_ref: q̇_ref ``(nv,)``; of the tasks, not measured, so that friction is overcome also from rest.
            measurement: that is answered.
        """
        velocity = v_ref[JOINT_VELOCITY]
        torque, saturated = _torque(torque, velocity, measurement.joint_velocity, self._arms, self._law)
        if saturated < 0:
            return self.resting(None, measurement)
        self.saturated_ticks += saturated
        return Command(
            torque=torque,
            position=measurement.joint_position,
            velocity=velocity,
            stiffness=self._zeros,
            damping=self._law.joint_damping,
            state_time=measurement.time,
            state_sequence=measurement.sequence,
        )

    def room(self, v_ref: np.ndarray, measurement: Measurement) -> Room:
        """Return the torques that inverse dynamics may ask for, given what friction and damping take of the limits.

        Args:
            v_ref: q̇_ref ``(nv,)``.
            measurement: that is answered.
        """
        return _room(v_ref[JOINT_VELOCITY], measurement.joint_velocity, self._law)

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


def _lightness(robot: Robot, damping: float) -> np.ndarray:
    """Return by what share ``(n,)`` of the gains each joint is led: less where it moves too little for all of it.

    It is that of the damping while the robot moves; a stop's, which is several times as strong, is lowered alike.
    """
    if damping == 0.0:
        return np.ones(robot.n_joints)
    state = Kinematics(robot).at(robot.standing_configuration(), np.zeros(robot.model.nv))
    inertia = 1.0 / np.diag(state.M_inv)[JOINT_VELOCITY]  # with all others free [kg·m²]
    return np.minimum(1.0, _FASTEST * inertia / damping)


@compiled
def _off_stops(velocity: np.ndarray, position: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> None:
    for j in range(len(velocity)):
        slowest, fastest = (lower[j] - position[j]) / _TO_STOP, (upper[j] - position[j]) / _TO_STOP
        velocity[j] = max(min(velocity[j], max(fastest, 0.0)), min(slowest, 0.0))


@compiled
def _room(velocity: np.ndarray, measured_velocity: np.ndarray, law: _Law) -> Room:
    """Return the torques that keep a share of the limits, less what rides along with them."""
    least, greatest = torque_bounds_of(
        measured_velocity,
        law.share * law.torque_max,
        law.share * law.bus_voltage,
        law.volts_per_torque,
        law.volts_per_speed,
    )
    along = friction_of(velocity, law.damping, law.dry_friction, law.stiction_speed)
    along += law.joint_damping * (velocity - measured_velocity)
    return Room(least - along, greatest - along)


@compiled
def _exceeds(
    torque: np.ndarray, velocity: np.ndarray, measured_velocity: np.ndarray, legs: np.ndarray, law: _Law
) -> bool:
    room = _room(velocity, measured_velocity, law)
    beyond = (torque < room.least) | (torque > room.greatest)
    return bool(np.any(beyond[legs]))


@compiled
def _torque(
    torque: np.ndarray, velocity: np.ndarray, measured_velocity: np.ndarray, arms: np.ndarray, law: _Law
) -> tuple[np.ndarray, int]:
    """Return the feed-forward torques ``(n,)`` [N·m], and whether the boards will be asked for too much: 1, 0.

    It is −1 if a torque is not finite.
    """
    torque = torque.copy()
    if len(arms) > 0:
        room = _room(velocity, measured_velocity, law)
        for j in arms:
            torque[j] = min(max(torque[j], room.least[j]), room.greatest[j])
    torque += friction_of(velocity, law.damping, law.dry_friction, law.stiction_speed)
    requested = torque + law.joint_damping * (velocity - measured_velocity)
    voltage = voltage_of(requested, measured_velocity, law.volts_per_torque, law.volts_per_speed)
    saturated = 0
    for j in range(len(torque)):
        if not np.isfinite(torque[j]):
            return torque, -1
        if abs(requested[j]) > law.torque_max[j] or abs(voltage[j]) > law.bus_voltage[j]:
            saturated = 1
    return torque, saturated
