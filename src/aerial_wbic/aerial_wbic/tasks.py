"""The tasks of the whole-body controller in the order of their priority, thesis (3.26)–(3.29).

One function per physical statement. The feedback of (3.22), ẍ_cmd = ẍ_des + K_p (x_des − x) + K_d (ẋ_des − ẋ), is that
of a velocity that also closes the gap: ẍ_cmd = ẍ_des + K_d (ẋ_ref − ẋ) with ẋ_ref = ẋ_des + K_p / K_d (x_des − x).
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
        self._swinging: dict[bytes, np.ndarray] = {}  # what was asked before

    def swinging(self, contact: np.ndarray) -> np.ndarray:
        """Return the indices of the swinging joints, given which points ``(n_c,)`` carry load."""
        key = contact.tobytes()
        if key not in self._swinging:
            loaded = self._chains[contact].any(axis=0)
            self._swinging[key] = np.flatnonzero(self._chains[~contact].any(axis=0) & ~loaded)
        return self._swinging[key]


def prioritized_tasks(
    state: Configuration, target: WholeBodyTarget, limbs: Limbs, gains: ControllerGains
) -> list[Task]:
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
    n_loaded = 3 * len(loaded)
    J = np.zeros((n_loaded + len(swinging), len(state.v)))
    a, xdot = np.zeros((2, len(J)))
    J[:n_loaded] = state.J_contacts[target.contact].reshape(J[:n_loaded].shape)
    for row, i in enumerate(loaded):
        a[3 * row : 3 * row + 3] = -state.Jdot_v_c(i)
    if len(swinging):
        gap = target.joint_position[swinging] - state.q[JOINT_POSITION][swinging]
        J[n_loaded:, JOINT_VELOCITY][np.arange(len(swinging)), swinging] = 1.0
        xdot[n_loaded:] = target.joint_velocity[swinging] + feedback.rate * gap
        slack = xdot[n_loaded:] - state.v[JOINT_VELOCITY][swinging]
        a[n_loaded:] = target.joint_acceleration[swinging] + feedback.damping * slack
    return Task(J=J, a=a, xdot=xdot)


def base_task(state: Configuration, body: BodyTarget) -> Task:
    """Task 1, (3.27): attitude of the base and position of the body, the latter as its centre of mass.

    The centre of mass stands for the base position, which follows from it when the limbs are where task 0 puts them:
    it is what a ballistic flight and the balance after landing depend on, whatever the limbs' errors.
    """
    R = state.R_WB
    mass = state.robot.mass
    J = np.zeros((6, len(state.v)))
    J[ANGULAR, BASE_ANGULAR] = R
    J[LINEAR] = state.A_G[LINEAR] / mass
    attitude, position = body.gains.attitude, body.gains.position
    turn = attitude_error(body.orientation, state.base_orientation)
    omega_ref = body.angular_velocity + attitude.rate * turn
    angular = body.angular_acceleration + attitude.damping * (omega_ref - R @ state.v[BASE_ANGULAR])
    rdot_ref = body.com_velocity + position.rate * (body.com - state.com)
    linear = body.com_acceleration + position.damping * (rdot_ref - state.com_velocity)
    return Task(
        J=J,
        a=np.concatenate([angular, linear - state.Adot_v_G[LINEAR] / mass]),
        xdot=np.concatenate([omega_ref, rdot_ref]),
    )


def angular_momentum_task(state: Configuration, target: WholeBodyTarget, damping: float) -> Task:
    """Task 2, (3.28)–(3.29): α̇_cmd = α̇_des + K_d,CAM (α_des − α), with no position to feed back."""
    alphadot = target.angular_momentum_rate + damping * (target.angular_momentum - state.angular_momentum)
    return Task(J=state.A_G[ANGULAR], a=alphadot - state.Adot_v_G[ANGULAR], xdot=target.angular_momentum)


def attitude_error(desired: np.ndarray, actual: np.ndarray) -> np.ndarray:
    """Return Log(R_des Rᵀ) ``(3,)`` [rad] in W, of attitudes given as quaternions ``(4,)``."""
    return rotation.log(rotation.multiply(desired, rotation.conjugate(actual)))
