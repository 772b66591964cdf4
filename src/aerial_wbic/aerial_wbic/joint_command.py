"""From accelerations and forces to what the motor boards are told, and the count of what they cannot give."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.kinematics import Kinematics
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.layout import Layout
from aerial_model.robot.compiled_actuator import friction_of, torque_bounds_of, voltage_of
from aerial_model.robot.robot import JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_model.values.command import Command
from aerial_model.values.measurement import Measurement
from aerial_wbic.force_qp.equations import TorqueHeadroom
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
    block: np.ndarray  # what all of it lies in


LAW = Layout(
    sizes=("n",),
    numbers=("stiction_speed", "share"),
    arrays={
        "torque_max": ("n",),
        "bus_voltage": ("n",),
        "volts_per_torque": ("n",),
        "volts_per_speed": ("n",),
        "damping": ("n",),
        "dry_friction": ("n",),
        "joint_damping": ("n",),
        "lower_stop": ("n",),
        "upper_stop": ("n",),
        "is_arm": ("n",),
    },
)
law_in = LAW.reader(_Law)


def _law_of(robot: Robot, gains: ControllerGains, joint_damping: np.ndarray) -> _Law:
    """Return the law of a robot's actuators, with the gains that a tick needs beside it."""
    actuators, model = robot.actuators, robot.model
    law = law_in(LAW.block(n=robot.n_joints, stiction_speed=gains.stiction_speed, share=gains.actuator_share))
    for name in ("torque_max", "bus_voltage", "volts_per_torque", "volts_per_speed", "damping", "dry_friction"):
        getattr(law, name)[:] = getattr(actuators, name)
    law.joint_damping[:] = joint_damping
    law.lower_stop[:] = model.lowerPositionLimit[JOINT_POSITION]
    law.upper_stop[:] = model.upperPositionLimit[JOINT_POSITION]
    law.is_arm[:] = np.isin(np.arange(robot.n_joints), robot.arms)
    return law


class JointCommands:
    """Makes the joint commands: friction feed-forward and limits.

    A command asks for what the motion needs, also beyond a limit: the boards limit it by the same actuator law, and
    ``saturated_ticks`` tells how often.
    """

    def __init__(self, robot: Robot, gains: ControllerGains) -> None:
        lightness = _lightness(robot, gains.joint_damping)
        self._zeros = np.zeros(robot.n_joints)
        self._joint_damping = gains.joint_damping * lightness
        self._law = _law_of(robot, gains, self._joint_damping).block
        self._posture_stiffness = gains.posture_stiffness * lightness
        self._stop_damping = gains.stop_damping * lightness
        self.saturated_ticks = 0

    def exceeds(self, torque: np.ndarray, v_ref: np.ndarray, measurement: Measurement) -> bool:
        """Return whether a torque ``(n,)`` [N·m] of a joint that can bear load leaves its headroom; the rest as for ``headroom``."""
        return _exceeds(torque, v_ref, measurement.joint_position, measurement.joint_velocity, self._law)

    def command(self, torque: np.ndarray, v_ref: np.ndarray, measurement: Measurement) -> Command:
        """Return the command for the torques that the equations of motion ask for.

        To them it adds the friction of the joints moving at q̇_ref. Damping about q̇_ref rides along, but for what would run
        a joint into its stop. Arms, which bear nothing, are asked for no more than they have headroom for. Whatever happened
        before, a command is finite: else the joints are only damped.

        Args:
            torque: of the joints ``(n,)`` [N·m].
            v_ref: q̇_ref ``(nv,)``; of the tasks, not measured, so that friction is overcome also from rest.
            measurement: that is answered.
        """
        torque, velocity = torque.copy(), np.empty(len(torque))
        saturated = _feed_forward(
            torque, velocity, v_ref, measurement.joint_position, measurement.joint_velocity, self._law
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

    def headroom(self, v_ref: np.ndarray, measurement: Measurement) -> TorqueHeadroom:
        """Return the torques that inverse dynamics may ask for, given what friction and damping take of the limits.

        Args:
            v_ref: q̇_ref ``(nv,)``.
            measurement: that is answered.
        """
        n = len(measurement.joint_position)
        headroom = TorqueHeadroom(np.empty(n), np.empty(n))
        _write_headroom(headroom, v_ref, measurement.joint_position, measurement.joint_velocity, self._law)
        return headroom

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
    return float(max(min(v_ref[JOINT_VELOCITY.start + j], max(fastest, 0.0)), min(slowest, 0.0)))


@compiled
def _headroom_of(law: _Law, j: int, velocity: float, measured_velocity: float) -> tuple[float, float]:
    """Return the torques that keep a share of a joint's limits, less what rides along with them."""
    least, greatest = torque_bounds_of(
        measured_velocity,  # type: ignore[arg-type]  # written for arrays, the same for numbers
        law.share * law.torque_max[j],
        law.share * law.bus_voltage[j],
        law.volts_per_torque[j],
        law.volts_per_speed[j],
    )
    along = friction_of(velocity, law.damping[j], law.dry_friction[j], law.stiction_speed)  # type: ignore[arg-type]
    along += law.joint_damping[j] * (velocity - measured_velocity)
    return least - along, greatest - along


@compiled
def _write_headroom(
    headroom: TorqueHeadroom,
    v_ref: np.ndarray,
    position: np.ndarray,
    measured_velocity: np.ndarray,
    law_block: np.ndarray,
) -> None:
    law = law_in(law_block)
    for j in range(len(position)):
        velocity = _off_stop(law, j, v_ref, position[j])
        headroom.least[j], headroom.greatest[j] = _headroom_of(law, j, velocity, measured_velocity[j])


@compiled
def _exceeds(
    torque: np.ndarray, v_ref: np.ndarray, position: np.ndarray, measured_velocity: np.ndarray, law_block: np.ndarray
) -> bool:
    law = law_in(law_block)
    for j in range(len(torque)):
        if law.is_arm[j] == 0.0:
            least, greatest = _headroom_of(law, j, _off_stop(law, j, v_ref, position[j]), measured_velocity[j])
            if torque[j] < least or torque[j] > greatest:
                return True
    return False


@compiled
def _feed_forward(
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
    law, saturated = law_in(law_block), 0
    for j in range(len(torque)):
        velocity[j] = _off_stop(law, j, v_ref, position[j])
        if law.is_arm[j] != 0.0:
            least, greatest = _headroom_of(law, j, velocity[j], measured_velocity[j])
            torque[j] = min(max(torque[j], least), greatest)
        torque[j] += friction_of(velocity[j], law.damping[j], law.dry_friction[j], law.stiction_speed)
        if not np.isfinite(torque[j]):
            return -1
        requested = torque[j] + law.joint_damping[j] * (velocity[j] - measured_velocity[j])
        voltage = voltage_of(requested, measured_velocity[j], law.volts_per_torque[j], law.volts_per_speed[j])
        if abs(requested) > law.torque_max[j] or abs(voltage) > law.bus_voltage[j]:
            saturated = 1
    return saturated
