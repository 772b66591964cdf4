"""Tasks in strict priority: the acceleration that meets the first task, then as much of the next as is left, and so on.

Next to it, for comparison, all tasks at once with weights.

Null-space projection with dynamically consistent inverses, thesis (3.20)–(3.23). What is left of a task under those above
it may have any rank, zero included. Two absolute thresholds tell what it is: a relative one would take the rounding noise
of an exhausted J N for a task and make accelerations of 1e13. What is left but hardly moves (arms that hang straight
down cannot turn a body about the vertical) is moved by a damped inverse: the less, the less it can do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.compiled import cholesky, cholesky_solve, compiled

# Eigenvalues of J H⁻¹ Jᵀ, inverse inertias [1/kg].
MOVABLE = (
    0.01  # a direction that moves this much less than the robot as a whole is accelerated by half of what is asked
)
NOISE = 1e-9  # a direction below this is left to lower tasks
_CERTAIN = 10.0  # times as movable: damping would change a hundredth
EFFORT = 1e-3  # ε of weighted tasks [1/kg]: settles what none of them asks for, and hardly weighs on what they do


class Task(NamedTuple):
    """One physical statement about a task coordinate x with ẋ = J q̇: its acceleration and its velocity.

    The velocity is not needed for the acceleration; it tells which way the joints are about to move.
    """

    J: np.ndarray  # (m, nv)
    a: np.ndarray  # ẍ_cmd − J̇ q̇ (m,)
    xdot: np.ndarray  # ẋ_ref (m,)


@compiled
def prioritized(M_inv: np.ndarray, tasks: tuple[Task, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return q̈_cmd and q̇_ref ``(nv,)`` of tasks in falling priority, thesis (3.23), the same for both.

    Of those that do equally well they are the ones of least kinetic energy, the least in the metric of H.

    Args:
        M_inv: H⁻¹ ``(nv, nv)``.
        tasks: the first is the most important; a task of no rows is allowed.
    """
    nv = len(M_inv)
    command = np.zeros((nv, 2))  # columns q̈_cmd, q̇_ref
    N = np.eye(nv)  # projects on what the tasks so far leave free
    free = nv  # dimensions of that
    for task in tasks:
        if len(task.a) > 0 and free > 0:
            J_pre = task.J @ N
            J_bar, J_bar_owned, rank = consistent_inverses(J_pre, M_inv)
            gap = np.empty((len(task.a), 2))
            gap[:, 0], gap[:, 1] = task.a, task.xdot
            command += J_bar @ (gap - task.J @ command)
            free -= rank
            N -= J_bar_owned @ J_pre
    return command[:, 0].copy(), command[:, 1].copy()


@compiled
def weighted(M: np.ndarray, tasks: tuple[Task, ...], weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return q̈_cmd and q̇_ref ``(nv,)`` of tasks that compete: min Σ w_i ‖J_i q̈ − a_i‖² + ε q̈ᵀ H q̈, the same for q̇_ref.

    Args:
        M: H ``(nv, nv)``.
        tasks: a task of no rows is allowed.
        weights: w_i, one a task.
    """
    A = EFFORT * M
    b = np.zeros((len(M), 2))  # columns q̈_cmd, q̇_ref
    for i, task in enumerate(tasks):
        Jt = weights[i] * task.J.T
        A += Jt @ task.J
        b[:, 0] += Jt @ task.a
        b[:, 1] += Jt @ task.xdot
    L = np.empty_like(A)
    cholesky(A, L)
    cholesky_solve(L, b)
    return b[:, 0].copy(), b[:, 1].copy()


@compiled
def consistent_inverses(J: np.ndarray, M_inv: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Return J^dyn = H⁻¹ Jᵀ (J H⁻¹ Jᵀ)⁺ ``(nv, m)``, thesis (3.20), of what can be moved and of all that J owns.

    The third is the number of directions J ``(m, nv)`` owns. As a rule all can be moved and both are the same.
    """
    J_M_inv = J @ M_inv
    A = J_M_inv @ J.T
    L = np.empty_like(A)
    enough = MOVABLE * M_inv[0, 0]
    if cholesky(A, L) > _CERTAIN * enough:  # every row adds to those before
        cholesky_solve(L, J_M_inv)
        J_bar = np.ascontiguousarray(J_M_inv.T)
        return J_bar, J_bar, len(A)
    eigenvalues, U = np.linalg.eigh(A)
    M_inv_Jt_U = J_M_inv.T @ np.ascontiguousarray(U)
    movable, owned = np.zeros((2, len(A)))
    rank = 0
    for i, eigenvalue in enumerate(eigenvalues):
        if eigenvalue > NOISE:
            owned[i] = 1 / eigenvalue
            rank += 1
            movable[i] = eigenvalue / (eigenvalue**2 + enough**2)
    Ut = np.ascontiguousarray(U.T)
    return (M_inv_Jt_U * movable) @ Ut, (M_inv_Jt_U * owned) @ Ut, rank
