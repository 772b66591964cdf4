"""Tasks in strict priority: the acceleration that meets the first task, then as much of the next as is left, and so on.

Null-space projection with dynamically consistent inverses, thesis (3.20)–(3.23). What is left of a task under those above
it may have any rank, zero included. Two absolute thresholds tell what it is: a relative one would take the rounding noise
of an exhausted J N for a task and make accelerations of 1e13.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

# Eigenvalues of J H⁻¹ Jᵀ, inverse inertias [1/kg] (for momenta: [kg]).
MOVABLE = (
    1e-3  # a direction below this belongs to its task but is not accelerated: what would move a tonne is not tried
)
NOISE = 1e-9  # a direction below this is left to lower tasks


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """One physical statement about a task coordinate x with ẋ = J q̇: its acceleration and its velocity.

    The velocity is not needed for the acceleration; it tells which way the joints are about to move.
    """

    J: np.ndarray  # (m, nv)
    a: np.ndarray  # ẍ_cmd − J̇ q̇ (m,)
    xdot: np.ndarray  # ẋ_ref (m,)


def prioritized(M_inv: np.ndarray, tasks: Iterable[Task]) -> tuple[np.ndarray, np.ndarray]:
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
        if not len(task.a):
            continue
        J_pre = task.J @ N
        J_bar, J_bar_owned, rank = consistent_inverses(J_pre, M_inv)
        command = command + J_bar @ (np.column_stack([task.a, task.xdot]) - task.J @ command)
        free -= rank
        if free == 0:
            break
        N = N - J_bar_owned @ J_pre
    return command[:, 0], command[:, 1]


def consistent_inverses(J: np.ndarray, M_inv: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Return J^dyn = H⁻¹ Jᵀ (J H⁻¹ Jᵀ)⁺ ``(nv, m)``, thesis (3.20), of what can be moved and of all that J owns.

    The third is the number of directions J ``(m, nv)`` owns. As a rule all can be moved and both are the same.
    """
    M_inv_Jt = M_inv @ J.T
    A = J @ M_inv_Jt
    if _is_movable(A):
        J_bar = M_inv_Jt @ np.linalg.inv(A)
        return J_bar, J_bar, len(A)
    eigenvalues, U = np.linalg.eigh(A)
    movable, owned = eigenvalues > MOVABLE, eigenvalues > NOISE
    inverse_of = [M_inv_Jt @ ((U[:, some] / eigenvalues[some]) @ U[:, some].T) for some in (movable, owned)]
    return inverse_of[0], inverse_of[1], int(owned.sum())


def _is_movable(A: np.ndarray) -> bool:
    """Return whether every row of a symmetric matrix ``(m, m)`` adds to those before: the usual case, cheap to see."""
    try:
        pivots = np.linalg.cholesky(A).diagonal()
    except np.linalg.LinAlgError:
        return False
    return bool(pivots.min() ** 2 > MOVABLE)
