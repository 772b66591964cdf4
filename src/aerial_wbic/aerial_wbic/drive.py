"""From accelerations and forces to what the motor boards are told, and the count of what they cannot give."""

from __future__ import annotations

import numpy as np

from aerial_model.kinematics import Configuration
from aerial_model.robot import JOINT_VELOCITY, Robot
from aerial_model.state import Command, Measurement
from aerial_wbic.gains import ControllerGains
from aerial_wbic.qp import Solution
from aerial_wbic.target import PostureTarget


class Drive:
    """Inverse dynamics, friction feed-forward and limits.

    A command asks for what the motion needs, also beyond a limit: the boards limit it by the same actuator law, and
    ``saturated_ticks`` tells how often.
    """

    def __init__(self, robot: Robot, gains: ControllerGains) -> None:
        self._law = robot.actuators
        self._stiction_speed = gains.stiction_speed
        n = robot.n_joints
        self._zeros = np.zeros(n)
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
        torque = inverse_dynamics(state, solution) + self._law.friction(velocity, self._stiction_speed)
        if not np.isfinite(torque).all():
            return self.resting(None, measurement)
        command = Command(
            torque=torque,
            position=measurement.joint_position,
            velocity=velocity,
            stiffness=self._zeros,
            damping=self._joint_damping,
            state_time=measurement.time,
            state_sequence=measurement.sequence,
        )
        self._count(command, measurement)
        return command

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

    def _count(self, command: Command, measurement: Measurement) -> None:
        speed = measurement.joint_velocity
        torque = command.requested_torque(measurement.joint_position, speed)
        if (self._law.torque_ratio(torque) > 1).any() or (self._law.voltage_ratio(torque, speed) > 1).any():
            self.saturated_ticks += 1


def inverse_dynamics(state: Configuration, solution: Solution) -> np.ndarray:
    """Return the joint torques ``(n,)`` [N·m], the joint rows of H q̈ + C q̇ + G − Σ J_c,iᵀ f_i, thesis (2.2)."""
    J_joints = state.J_contacts[:, :, JOINT_VELOCITY].reshape(solution.force.size, -1)  # (3 n_c, n)
    return state.M[JOINT_VELOCITY] @ solution.vdot + state.nle[JOINT_VELOCITY] - solution.force.ravel() @ J_joints
