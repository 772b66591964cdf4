"""The tasks of the whole-body controller in the order of their priority, thesis (3.26)–(3.29).

One function per physical statement; each returns J and ẍ_cmd − J̇ q̇ with the feedback of (3.22),
ẍ_cmd = ẍ_des + K_p (x_des − x) + K_d (ẋ_des − ẋ).
"""

from __future__ import annotations

import numpy as np

from aerial_model import rotation
from aerial_model.kinematics import Configuration
from aerial_model.robot import BASE_ANGULAR, JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_wbic.gains import ControllerGains, Feedback
from aerial_wbic.hierarchy import Task
from aerial_wbic.target import BodyTarget, WholeBodyTarget

ANGULAR = slice(0, 3)  # rows of A_G and of momenta, thesis (2.5)
LINEAR = slice(3, 6)


class Limbs:
    """Which joints carry which contact point: a limb swings when its point is in the air and no loaded one needs it."""

    def __init__(self, robot: Robot) -> None:
        model = robot.model
        chains = np.zeros((robot.n_contacts, robot.n_joints), dtype=bool)
        for i, frame in enumerate(robot.contact_frames):
            for joint in list(model.supports[model.frames[frame].parentJoint])[2:]:  # 0: universe, 1: base
                chains[i, model.joints[joint].idx_v - JOINT_VELOCITY.start] = True
        self._chains = chains  # (n_c, n)

    def swinging(self, contact: np.ndarray) -> np.ndarray:
        """Return the indices of the swinging joints, given which points ``(n_c,)`` carry load."""
        loaded = self._chains[contact].any(axis=0)
        return np.flatnonzero(self._chains[~contact].any(axis=0) & ~loaded)


def prioritized_tasks(state: Configuration, target: WholeBodyTarget, limbs: Limbs, gains: ControllerGains) -> list[Task]:
    """Return the controller's tasks at ``state``, most important first."""
    return [
        limb_task(state, target, limbs.swinging(target.contact), gains.swing_joint),
        base_task(state, target.body),
        angular_momentum_task(state, target, gains.angular_momentum_damping),
    ]


def limb_task(state: Configuration, target: WholeBodyTarget, swinging: np.ndarray, feedback: Feedback) -> Task:
    """Task 0, (3.26): loaded contact points do not accelerate, limbs in the air follow their course.

    A swinging limb is led in joint space, relative to the base: in the air its end effector follows from the joints
    without a singularity, and the base, which nothing can steer there, does not pull it off its course.
    """
    loaded = np.flatnonzero(target.contact)
    J = np.zeros((3 * len(loaded) + len(swinging), len(state.v)))
    a = np.zeros(len(J))
    for row, i in enumerate(loaded):
        rows = slice(3 * row, 3 * row + 3)
        J[rows] = state.J_c(i)
        a[rows] = -state.Jdot_v_c(i)
    if len(swinging):
        rows = slice(3 * len(loaded), None)
        q, v = state.q[JOINT_POSITION][swinging], state.v[JOINT_VELOCITY][swinging]
        J[rows, JOINT_VELOCITY][np.arange(len(swinging)), swinging] = 1.0
        a[rows] = (
            target.joint_acceleration[swinging]
            + feedback.stiffness * (target.joint_position[swinging] - q)
            + feedback.damping * (target.joint_velocity[swinging] - v)
        )
    return Task(J=J, a=a)


def base_task(state: Configuration, body: BodyTarget) -> Task:
    """Task 1, (3.27): attitude of the base and position of the body, the latter as its centre of mass.

    The centre of mass stands for the base position, which follows from it when the limbs are where task 0 puts them:
    it is what a ballistic flight and the balance after landing depend on, whatever the limbs' errors.
    """
    R = state.R_WB
    A, bias, mass = state.A_G, state.Adot_v_G, state.robot.mass
    J = np.zeros((6, len(state.v)))
    J[ANGULAR, BASE_ANGULAR] = R
    J[LINEAR] = A[LINEAR] / mass
    attitude, position = body.gains.attitude, body.gains.position
    angular_velocity = R @ state.v[BASE_ANGULAR]
    angular = (
        body.angular_acceleration
        + attitude.stiffness * attitude_error(body.orientation, state.base_orientation)
        + attitude.damping * (body.angular_velocity - angular_velocity)
    )
    linear = (
        body.com_acceleration
        + position.stiffness * (body.com - state.com)
        + position.damping * (body.com_velocity - state.com_velocity)
        - bias[LINEAR] / mass
    )
    return Task(J=J, a=np.concatenate([angular, linear]))


def angular_momentum_task(state: Configuration, target: WholeBodyTarget, damping: float) -> Task:
    """Task 2, (3.28)–(3.29): α̇_cmd = α̇_des + K_d,CAM (α_des − α), with no position to feed back."""
    alphadot = target.angular_momentum_rate + damping * (target.angular_momentum - state.angular_momentum)
    return Task(J=state.A_G[ANGULAR], a=alphadot - state.Adot_v_G[ANGULAR])


def attitude_error(desired: np.ndarray, actual: np.ndarray) -> np.ndarray:
    """Return Log(R_des Rᵀ) ``(3,)`` [rad] in W, from quaternions ``(4,)``."""
    return rotation.log(rotation.multiply(desired, rotation.conjugate(actual)))
