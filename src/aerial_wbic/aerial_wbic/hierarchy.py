"""Tasks in strict priority: the acceleration that meets the first task, then as much of the next as is left, and so on.

Null-space projection with dynamically consistent inverses, thesis (3.20)–(3.23). What is left of a task under those
above it may have any rank, zero included; the rank is tested against an absolute threshold, because the entries of an
exhausted J N are rounding noise, of which a relative threshold would make accelerations of 1e13.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

RANK_THRESHOLD = 1e-7  # least eigenvalue of J H⁻¹ Jᵀ that counts, an inverse inertia [1/kg] (or [kg] for momenta)


@dataclass(frozen=True, kw_only=True)
class Task:
    """One physical statement about the generalized acceleration: J q̈ = a, with a = ẍ_cmd − J̇ q̇."""

    J: np.ndarray  # (m, nv)
    a: np.ndarray  # (m,)


def prioritized(M_inv: np.ndarray, tasks: Iterable[Task]) -> np.ndarray:
    """Return q̈_cmd ``(nv,)`` of tasks in falling priority, thesis (3.23).

    Of the accelerations that do equally well it is the one of least kinetic energy, ‖q̈‖ in the metric of H.

    Args:
        M_inv: H⁻¹ ``(nv, nv)``.
        tasks: the first is the most important; a task of no rows is allowed.
    """
    nv = len(M_inv)
    vdot = np.zeros(nv)
    N = np.eye(nv)  # projects on what the tasks so far leave free
    for task in tasks:
        if not len(task.a):
            continue
        J_pre = task.J @ N
        J_bar, rank = consistent_inverse(J_pre, M_inv)
        if rank == 0:
            continue
        vdot = vdot + J_bar @ (task.a - task.J @ vdot)
        N = N - J_bar @ J_pre
    return vdot


def consistent_inverse(J: np.ndarray, M_inv: np.ndarray) -> tuple[np.ndarray, int]:
    """Return J^dyn = H⁻¹ Jᵀ (J H⁻¹ Jᵀ)⁺ ``(nv, m)``, thesis (3.20), and the rank of J ``(m, nv)``."""
    M_inv_Jt = M_inv @ J.T
    eigenvalues, U = np.linalg.eigh(J @ M_inv_Jt)  # ascending
    lost = int(np.searchsorted(eigenvalues, RANK_THRESHOLD))
    U = U[:, lost:]
    return M_inv_Jt @ ((U / eigenvalues[lost:]) @ U.T), len(eigenvalues) - lost
