"""The tasks of the whole-body controller, thesis (3.26)–(3.29), and the accelerations that they make together.

One function per physical statement. The feedback of (3.22), ẍ_cmd = ẍ_des + K_p (x_des − x) + K_d (ẋ_des − ẋ), is that
of a velocity that also closes the gap: ẍ_cmd = ẍ_des + K_d (ẋ_ref − ẋ) with ẋ_ref = ẋ_des + K_p / K_d (x_des − x).
"""

from __future__ import annotations

import numpy as np

from aerial_model.kinematics import Configuration, configuration_in
from aerial_model.numerics.components import inverse_of, log_of, product_of, quaternion
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.linalg import cholesky, cholesky_solve
from aerial_model.robot.robot import BASE_ANGULAR, BASE_ORIENTATION, JOINT_POSITION, JOINT_VELOCITY
from aerial_wbic.gains import Feedback
from aerial_wbic.target import BodyTarget, WholeBodyTarget, target_in
from aerial_wbic.tasks.hierarchy import (
    Task,
    add_by_null_space,
    add_weighted,
    least_energy_solution,
    no_equations,
    no_tasks,
    weighted_solution,
)
from aerial_wbic.tasks.limbs import Joints, joints_in
from aerial_wbic.tasks.ordering import TaskKind, TaskOrdering, ordering_in

ANGULAR = slice(0, 3)  # rows of A_G and of momenta, thesis (2.5)
LINEAR = slice(3, 6)

_SWIVEL = 1e-9  # [m²] of J Jᵀ, below which joints do not move a point


@compiled
def command(
    state_block: np.ndarray,
    target_block: np.ndarray,
    joints_block: np.ndarray,
    ordering_block: np.ndarray,
    vdot: np.ndarray,
    v_ref: np.ndarray,
) -> None:
    """Write q̈_cmd and q̇_ref ``(nv,)`` of the controller's tasks."""
    state, target = configuration_in(state_block), target_in(target_block)
    joints, ordering = joints_in(joints_block), ordering_in(ordering_block)
    if len(ordering.weights) > 0:
        equations = no_equations(state.M)
        for i, weight in enumerate(ordering.weights):
            add_weighted(equations, task_of(int(ordering.order[i]), state, target, joints, ordering), weight)
        weighted_solution(equations, vdot, v_ref)
        return
    tasks, owned = no_tasks(state.L), 0
    for kind in ordering.order:
        if owned < len(vdot) and (kind != TaskKind.SPARE_JOINTS.value or len(joints.spare) > 0):
            owned = add_by_null_space(tasks, owned, task_of(int(kind), state, target, joints, ordering))
    least_energy_solution(tasks, vdot, v_ref)


@compiled
def task_of(kind: int, state: Configuration, target: WholeBodyTarget, joints: Joints, ordering: TaskOrdering) -> Task:
    """Return what a ``TaskKind`` states at ``state``."""
    if kind == TaskKind.LIMBS:
        return limb_task(state, target, joints, ordering.limbs)
    if kind == TaskKind.BASE:
        return base_task(state, target.body)
    if kind == TaskKind.ANGULAR_MOMENTUM:
        return angular_momentum_task(state, target, ordering.angular_momentum_damping)
    if kind == TaskKind.MOMENTUM:
        return momentum_task(state, target, ordering.angular_momentum_damping)
    if kind == TaskKind.SPARE_JOINTS:
        return spare_joint_task(state, target, joints, ordering.limbs)
    if kind == TaskKind.POSTURE:
        return posture_task(state, target, joints.posed, ordering.limbs)
    return Task(np.zeros((0, len(state.v))), np.zeros(0), np.zeros(0))


@compiled
def limb_task(state: Configuration, target: WholeBodyTarget, joints: Joints, feedback: Feedback) -> Task:
    """(3.26), the first of all: loaded contact points do not accelerate, limbs in the air follow their course.

    A swinging limb is led in joint space, relative to the base: in the air its end effector follows from the joints
    without a singularity, and the base, which nothing can steer there, does not pull it off its course.

    Of the points of one link the first gives three rows, the second what is across the line to the first, the third what
    is across the plane of all three: together they say that the link does not move, and no row says it twice.
    """
    rows = joints.rank.sum() + len(joints.swinging)
    J = np.zeros((rows, len(state.v)))
    a, xdot = np.zeros(rows), np.zeros(rows)
    row = 0
    for i in range(len(joints.rank)):
        rank = joints.rank[i]
        if rank == 3:
            for axis in range(3):
                a[row + axis] = -state.Jdot_v_contacts[i, axis]
                for k in range(len(state.v)):
                    J[row + axis, k] = state.J_contacts[i, axis, k]
        elif rank > 0:
            across = _across(state.contact_positions, i, joints.mate[i])[:rank]
            first = joints.mate[i, 0]
            J[row : row + rank] = across @ state.J_contacts[i]
            a[row : row + rank] = -(across @ state.Jdot_v_contacts[i])
            # Level ground bears all points of a foot; one that bears little is not put back by it.
            rise = state.contact_positions[i, 2] - state.contact_positions[first, 2]
            rate = across @ ((state.J_contacts[i] - state.J_contacts[first]) @ state.v)
            xdot[row : row + rank] = -feedback.stiffness / feedback.damping * rise * across[:, 2]
            a[row : row + rank] += feedback.damping * (xdot[row : row + rank] - rate)
        row += rank
    _lead(state, target, joints.swinging, feedback, Task(J[row:], a[row:], xdot[row:]))
    return Task(J, a, xdot)


@compiled
def _across(points: np.ndarray, i: int, mate: np.ndarray) -> np.ndarray:
    """Return unit vectors ``(2, 3)`` across the line from point i to the first of its link.

    If i is the third of its link, the first of them is across the plane through the first two as well.
    """
    along = points[i] - points[mate[0]]
    other = points[mate[1]] - points[mate[0]]
    if i == mate[1]:  # the line is all there is: any direction that is not along it will do
        other = np.zeros(3)
        other[np.argmin(np.abs(along))] = 1.0
    first = np.cross(along, other)
    second = np.cross(along, first)
    across = np.empty((2, 3))
    across[0] = first / np.sqrt(first @ first)
    across[1] = second / np.sqrt(second @ second)
    return across


@compiled
def posture_task(state: Configuration, target: WholeBodyTarget, joints: np.ndarray, feedback: Feedback) -> Task:
    """Return the task that joints are where the plan has them: arms, or the legs as far as they are free."""
    task = Task(np.zeros((len(joints), len(state.v))), np.zeros(len(joints)), np.zeros(len(joints)))
    _lead(state, target, joints, feedback, task)
    return task


@compiled
def spare_joint_task(state: Configuration, target: WholeBodyTarget, joints: Joints, feedback: Feedback) -> Task:
    """Return the task that limbs with load follow the plan where neither base nor contact points say how they are to move.

    A leg that stands on its toes with more than three joints can swivel: its joints' motions are projected on those that
    leave its points at rest relative to the base.
    """
    task = posture_task(state, target, joints.spare, feedback)
    if len(joints.spare) == 0:
        return task
    loaded = np.flatnonzero(target.contact)
    J = np.empty((3 * len(loaded), len(joints.spare)))
    for i, point in enumerate(loaded):
        for column, j in enumerate(joints.spare):
            J[3 * i : 3 * i + 3, column] = state.J_contacts[point, :, JOINT_VELOCITY.start + j]
    A = J @ J.T
    for k in range(len(A)):
        A[k, k] += _SWIVEL
    L = np.empty_like(A)
    cholesky(A, L)
    held = J.copy()
    cholesky_solve(L, held)
    P = np.eye(len(joints.spare)) - J.T @ held
    return Task(P @ task.J, P @ task.a, P @ task.xdot)


@compiled
def _lead(state: Configuration, target: WholeBodyTarget, joints: np.ndarray, feedback: Feedback, rows: Task) -> None:
    """Write into ``rows`` that joints follow their course."""
    rate = feedback.stiffness / feedback.damping
    q_j, dq_j = state.q[JOINT_POSITION], state.v[JOINT_VELOCITY]
    for row, j in enumerate(joints):
        rows.J[row, JOINT_VELOCITY.start + j] = 1.0
        rows.xdot[row] = target.joint_velocity[j] + rate * (target.joint_position[j] - q_j[j])
        rows.a[row] = target.joint_acceleration[j] + feedback.damping * (rows.xdot[row] - dq_j[j])


@compiled
def base_task(state: Configuration, body: BodyTarget) -> Task:
    """(3.27): attitude of the base and position of the body, the latter as its centre of mass.

    The centre of mass stands for the base position, which follows from it when the limbs are where their task puts them:
    it is what a ballistic flight and the balance after landing depend on, whatever the limbs' errors.
    """
    task = Task(np.zeros((6, len(state.v))), np.empty(6), np.empty(6))
    attitude, first = body.gains.attitude, BASE_ANGULAR.start
    turn = attitude_error_of(quaternion(body.orientation), quaternion(state.q[BASE_ORIENTATION]))
    for i in range(3):
        omega = 0.0
        for k in range(3):
            task.J[i, first + k] = state.R_WB[i, k]
            omega += state.R_WB[i, k] * state.v[first + k]
        task.xdot[i] = body.angular_velocity[i] + attitude.stiffness / attitude.damping * turn[i]
        task.a[i] = body.angular_acceleration[i] + attitude.damping * (task.xdot[i] - omega)
    _lead_com(state, body, task)
    return task


@compiled
def momentum_task(state: Configuration, target: WholeBodyTarget, damping: float) -> Task:
    """All of the centroidal momentum: the angular part is that of (3.28)–(3.29), the linear part follows the body.

    The linear part feeds the position of the centre of mass back; nothing holds an attitude.
    """
    J = np.empty((6, len(state.v)))
    a, xdot = np.empty(6), np.empty(6)
    J[ANGULAR], a[ANGULAR], xdot[ANGULAR] = angular_momentum_task(state, target, damping)
    _lead_com(state, target.body, Task(J, a, xdot))
    return Task(J, a, xdot)


@compiled
def _lead_com(state: Configuration, body: BodyTarget, task: Task) -> None:
    """Write into the ``LINEAR`` rows of a task that the centre of mass follows its course."""
    position = body.gains.position
    for i in range(3):
        row, rate = LINEAR.start + i, position.stiffness / position.damping
        for k in range(len(state.v)):
            task.J[row, k] = state.A_G[row, k] / state.mass
        task.xdot[row] = body.com_velocity[i] + rate * (body.com[i] - state.com[i])
        task.a[row] = body.com_acceleration[i] + position.damping * (task.xdot[row] - state.com_velocity[i])
        task.a[row] -= state.Adot_v_G[row] / state.mass


@compiled
def angular_momentum_task(state: Configuration, target: WholeBodyTarget, damping: float) -> Task:
    """(3.28)–(3.29): α̇_cmd = α̇_des + K_d,CAM (α_des − α), with no position to feed back.

    It is divided by m k, with the radius of gyration k: in [m/s²]. In the air nothing changes α: to ask for it would only turn the base against the arms that try.
    """
    alphadot = target.angular_momentum_rate + damping * (target.angular_momentum - state.angular_momentum)
    if not target.contact.any():
        alphadot = np.zeros(3)
    # As the speed of the robot's mass at its radius of gyration: of the same size as what other tasks say.
    inertia = (state.A_G[ANGULAR, BASE_ANGULAR] * state.R_WB).sum() / 3  # mean of those with joints locked
    unit = np.sqrt(state.mass * inertia)
    return Task(state.A_G[ANGULAR] / unit, (alphadot - state.Adot_v_G[ANGULAR]) / unit, target.angular_momentum / unit)


@compiled
def attitude_error(desired: np.ndarray, actual: np.ndarray) -> np.ndarray:
    """Return Log(R_des Rᵀ) ``(3,)`` [rad] in W, of attitudes given as quaternions ``(4,)``."""
    return np.array(attitude_error_of(quaternion(desired), quaternion(actual)))


@compiled
def attitude_error_of(desired: tuple[float, ...], actual: tuple[float, ...]) -> tuple[float, ...]:
    """Return the components of Log(R_des Rᵀ) [rad] in W, of attitudes given by the components of quaternions."""
    return log_of(product_of(desired, inverse_of(actual)))
