"""The tasks of the whole-body controller in the order of their priority, thesis (3.26)–(3.29).

One function per physical statement. The feedback of (3.22), ẍ_cmd = ẍ_des + K_p (x_des − x) + K_d (ẋ_des − ẋ), is that
of a velocity that also closes the gap: ẍ_cmd = ẍ_des + K_d (ẋ_ref − ẋ) with ẋ_ref = ẋ_des + K_p / K_d (x_des − x).
"""

from __future__ import annotations

import numpy as np

from aerial_model.kinematics import Configuration
from aerial_model.robot import BASE_ANGULAR, BASE_ORIENTATION, JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_wbic.compiled import compiled, inverse_of, log_of, product_of, quaternion
from aerial_wbic.gains import Feedback
from aerial_wbic.hierarchy import Task, prioritized
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


@compiled
def command(
    state: Configuration,
    target: WholeBodyTarget,
    swinging: np.ndarray,
    swing_gains: Feedback,
    angular_momentum_damping: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return q̈_cmd and q̇_ref ``(nv,)`` of the controller's tasks; ``swinging`` are the joints of limbs in the air."""
    tasks = prioritized_tasks(state, target, swinging, swing_gains, angular_momentum_damping)
    return prioritized(state.M_inv, tasks)


@compiled
def prioritized_tasks(
    state: Configuration,
    target: WholeBodyTarget,
    swinging: np.ndarray,
    swing_gains: Feedback,
    angular_momentum_damping: float,
) -> tuple[Task, Task, Task]:
    """Return the controller's tasks at ``state``, most important first."""
    return (
        limb_task(state, target, swinging, swing_gains),
        base_task(state, target.body),
        angular_momentum_task(state, target, angular_momentum_damping),
    )


@compiled
def limb_task(state: Configuration, target: WholeBodyTarget, swinging: np.ndarray, feedback: Feedback) -> Task:
    """Task 0, (3.26): loaded contact points do not accelerate, limbs in the air follow their course.

    A swinging limb is led in joint space, relative to the base: in the air its end effector follows from the joints
    without a singularity, and the base, which nothing can steer there, does not pull it off its course.
    """
    rows = 3 * np.count_nonzero(target.contact) + len(swinging)
    J = np.zeros((rows, len(state.v)))
    a, xdot = np.zeros(rows), np.zeros(rows)
    row = 0
    for i in range(len(target.contact)):
        if target.contact[i]:
            J[row : row + 3] = state.J_contacts[i]
            a[row : row + 3] = -state.Jdot_v_contacts[i]
            row += 3
    rate = feedback.stiffness / feedback.damping
    joints = JOINT_VELOCITY.start
    q_j, dq_j = state.q[JOINT_POSITION], state.v[JOINT_VELOCITY]
    for j in swinging:
        J[row, joints + j] = 1.0
        xdot[row] = target.joint_velocity[j] + rate * (target.joint_position[j] - q_j[j])
        a[row] = target.joint_acceleration[j] + feedback.damping * (xdot[row] - dq_j[j])
        row += 1
    return Task(J, a, xdot)


@compiled
def base_task(state: Configuration, body: BodyTarget) -> Task:
    """Task 1, (3.27): attitude of the base and position of the body, the latter as its centre of mass.

    The centre of mass stands for the base position, which follows from it when the limbs are where task 0 puts them:
    it is what a ballistic flight and the balance after landing depend on, whatever the limbs' errors.
    """
    J = np.zeros((6, len(state.v)))
    a, xdot = np.empty(6), np.empty(6)
    attitude, position = body.gains.attitude, body.gains.position

    J[ANGULAR, BASE_ANGULAR] = state.R_WB
    turn = attitude_error(body.orientation, state.q[BASE_ORIENTATION])
    xdot[ANGULAR] = body.angular_velocity + attitude.stiffness / attitude.damping * turn
    omega = state.R_WB @ state.v[BASE_ANGULAR]
    a[ANGULAR] = body.angular_acceleration + attitude.damping * (xdot[ANGULAR] - omega)

    J[LINEAR] = state.A_G[LINEAR] / state.mass
    xdot[LINEAR] = body.com_velocity + position.stiffness / position.damping * (body.com - state.com)
    a[LINEAR] = body.com_acceleration + position.damping * (xdot[LINEAR] - state.com_velocity)
    a[LINEAR] -= state.Adot_v_G[LINEAR] / state.mass
    return Task(J, a, xdot)


@compiled
def angular_momentum_task(state: Configuration, target: WholeBodyTarget, damping: float) -> Task:
    """Task 2, (3.28)–(3.29): α̇_cmd = α̇_des + K_d,CAM (α_des − α), with no position to feed back."""
    alphadot = target.angular_momentum_rate + damping * (target.angular_momentum - state.angular_momentum)
    return Task(state.A_G[ANGULAR].copy(), alphadot - state.Adot_v_G[ANGULAR], target.angular_momentum.copy())


@compiled
def attitude_error(desired: np.ndarray, actual: np.ndarray) -> np.ndarray:
    """Return Log(R_des Rᵀ) ``(3,)`` [rad] in W, of attitudes given as quaternions ``(4,)``."""
    return np.array(log_of(product_of(quaternion(desired), inverse_of(quaternion(actual)))))
