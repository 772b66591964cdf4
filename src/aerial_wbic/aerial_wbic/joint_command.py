"""From accelerations and forces to what the motor boards are told, and the count of what they cannot give."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.kinematics import Kinematics
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.layout import cut
from aerial_model.robot.compiled_actuator import friction_of, torque_bounds_of, voltage_of
from aerial_model.robot.robot import JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_model.values.command import Command
from aerial_model.values.measurement import Measurement
from aerial_wbic.force_qp.optimization import Room
from aerial_wbic.gains import ControllerGains
from aerial_wbic.target import PostureTarget

_FASTEST = 500.0  # [1/s] at which damping may stop a joint by itself: faster, boards that sample would shake it
_TO_STOP = 0.01  # [s] in which no joint is to reach its stop


class _Law(NamedTuple):
    """What a tick needs of the actuator law and of the gains, arrays ``(n,)``; all of it lies in one block."""

    torque_max: np.ndarray
    bus_voltage: np.ndarray
    volts_per_torque: np.ndarray
    volts_per_speed: np.ndarray
    damping: np.ndarray
    dry_friction: np.ndarray
    joint_damping: np.ndarray  # [N·m·s/rad]
    lower_stop: np.ndarray  # [rad]
    upper_stop: np.ndarray  # [rad]
    is_arm: np.ndarray  # 1 or 0: bears nothing
    stiction_speed: float  # [rad/s]
    share: float  # of the limits that may be asked for


def _law_block(robot: Robot, gains: ControllerGains, joint_damping: np.ndarray) -> np.ndarray:
    law, model = robot.actuators, robot.model
    is_arm = np.isin(np.arange(robot.n_joints), robot.arms)
    lower_stop, upper_stop = model.lowerPositionLimit[JOINT_POSITION], model.upperPositionLimit[JOINT_POSITION]
    rows = [law.torque_max, law.bus_voltage, law.volts_per_torque, law.volts_per_speed, law.damping, law.dry_friction]
    rows += [joint_damping, lower_stop, upper_stop, is_arm]
    return np.concatenate([*rows, [gains.stiction_speed, gains.actuator_share]]).astype(float)


@compiled
def _law_in(block: np.ndarray) -> _Law:
    n = len(block) // 10
    torque_max, at = cut(block, 0, n)
    bus_voltage, at = cut(block, at, n)
    volts_per_torque, at = cut(block, at, n)
    volts_per_speed, at = cut(block, at, n)
    damping, at = cut(block, at, n)
    dry_friction, at = cut(block, at, n)
    joint_damping, at = cut(block, at, n)
    lower_stop, at = cut(block, at, n)
    upper_stop, at = cut(block, at, n)
    is_arm, at = cut(block, at, n)
    return _Law(
        torque_max,
        bus_voltage,
        volts_per_torque,
        volts_per_speed,
        damping,
        dry_friction,
        joint_damping,
        lower_stop,
        upper_stop,
        is_arm,
        block[at],
        block[at + 1],
    )


class Drive:
    """Friction feed-forward and limits.

    A command asks for what the motion needs, also beyond a limit: the boards limit it by the same actuator law, and
    ``saturated_ticks`` tells how often.
    """

    def __init__(self, robot: Robot, gains: ControllerGains) -> None:
        lightness = _lightness(robot, gains.joint_damping)
        self._zeros = np.zeros(robot.n_joints)
        self._joint_damping = gains.joint_damping * lightness
        self._law = _law_block(robot, gains, self._joint_damping)
        self._posture_stiffness = gains.posture_stiffness * lightness
        self._stop_damping = gains.stop_damping * lightness
        self.saturated_ticks = 0

    def exceeds(self, torque: np.ndarray, v_ref: np.ndarray, measurement: Measurement) -> bool:
        """Return whether a torque ``(n,)`` [N·m] of a joint that can bear load leaves its room; the rest as for ``room``."""
        return _exceeds(torque, v_ref, measurement.joint_position, measurement.joint_velocity, self._law)

    def command(self, torque: np.ndarray, v_ref: np.ndarray, measurement: Measurement) -> Command:
        """Return the command for the torques that the equations of motion ask for.

        To them it adds the friction of the joints moving at q̇_ref. Damping about q̇_ref rides along, but for what would run
        a joint into its stop. Arms, which bear nothing, are asked for no more than they have room for. Whatever happened
        before, a command is finite: else the joints are only damped.

        Args:
            torque: of the joints ``(n,)`` [N·m].
            v_ref: q̇_ref ``(nv,)``; of the tasks, not measured, so that friction is overcome also from rest.
            measurement: that is answered.
        """
        torque, velocity = torque.copy(), np.empty(len(torque))
        saturated = _driven(torque, velocity, v_ref, measurement.joint_position, measurement.joint_velocity, self._law)
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
        n = len(measurement.joint_position)
        room = Room(np.empty(n), np.empty(n))
        _write_room(room, v_ref, measurement.joint_position, measurement.joint_velocity, self._law)
        return room

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
    inertia = 1.0 / np.diag(np.linalg.inv(state.M))[JOINT_VELOCITY]  # with all others free [kg·m²]
    return np.minimum(1.0, _FASTEST * inertia / damping)


@compiled
def _off_stop(law: _Law, j: int, v_ref: np.ndarray, position: float) -> float:
    """Return what of a joint's q̇_ref does not run it into its stop: there is no going on, only torque in vain."""
    slowest, fastest = (law.lower_stop[j] - position) / _TO_STOP, (law.upper_stop[j] - position) / _TO_STOP
    return max(min(v_ref[JOINT_VELOCITY.start + j], max(fastest, 0.0)), min(slowest, 0.0))


@compiled
def _room_of(law: _Law, j: int, velocity: float, measured_velocity: float) -> tuple[float, float]:
    """Return the torques that keep a share of a joint's limits, less what rides along with them."""
    least, greatest = torque_bounds_of(
        measured_velocity,
        law.share * law.torque_max[j],
        law.share * law.bus_voltage[j],
        law.volts_per_torque[j],
        law.volts_per_speed[j],
    )
    along = friction_of(velocity, law.damping[j], law.dry_friction[j], law.stiction_speed)
    along += law.joint_damping[j] * (velocity - measured_velocity)
    return least - along, greatest - along


@compiled
def _write_room(
    room: Room, v_ref: np.ndarray, position: np.ndarray, measured_velocity: np.ndarray, law_block: np.ndarray
) -> None:
    law = _law_in(law_block)
    for j in range(len(position)):
        velocity = _off_stop(law, j, v_ref, position[j])
        room.least[j], room.greatest[j] = _room_of(law, j, velocity, measured_velocity[j])


@compiled
def _exceeds(
    torque: np.ndarray, v_ref: np.ndarray, position: np.ndarray, measured_velocity: np.ndarray, law_block: np.ndarray
) -> bool:
    law = _law_in(law_block)
    for j in range(len(torque)):
        if law.is_arm[j] == 0.0:
            least, greatest = _room_of(law, j, _off_stop(law, j, v_ref, position[j]), measured_velocity[j])
            if torque[j] < least or torque[j] > greatest:
                return True
    return False


@compiled
def _driven(
    torque: np.ndarray,
    velocity: np.ndarray,
    v_ref: np.ndarray,
    position: np.ndarray,
    measured_velocity: np.ndarray,
    law_block: np.ndarray,
) -> int:
    """Make torques ``(n,)`` [N·m] those to feed forward, and write the velocities that go with them.

    Return whether the boards will be asked for too much: 1, 0; −1 if a torque is not finite.
    """
    law, saturated = _law_in(law_block), 0
    for j in range(len(torque)):
        velocity[j] = _off_stop(law, j, v_ref, position[j])
        if law.is_arm[j] != 0.0:
            least, greatest = _room_of(law, j, velocity[j], measured_velocity[j])
            torque[j] = min(max(torque[j], least), greatest)
        torque[j] += friction_of(velocity[j], law.damping[j], law.dry_friction[j], law.stiction_speed)
        if not np.isfinite(torque[j]):
            return -1
        requested = torque[j] + law.joint_damping[j] * (velocity[j] - measured_velocity[j])
        voltage = voltage_of(requested, measured_velocity[j], law.volts_per_torque[j], law.volts_per_speed[j])
        if abs(requested) > law.torque_max[j] or abs(voltage) > law.bus_voltage[j]:
            saturated = 1
    return saturated
