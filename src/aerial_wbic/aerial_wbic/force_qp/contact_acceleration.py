"""How joints accelerate when the base gives way to forces that do not fit what is commanded: feet stay where they are.

That is E of q̈ = q̈_cmd + E δ_q in (3.24), where the thesis has [1; 0]; see ``qp`` for why.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.kinematics import Configuration
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.layout import cut_rows
from aerial_model.numerics.linalg import cholesky, cholesky_solve, invert, lower_solve, upper_solve
from aerial_model.robot.robot import JOINT_VELOCITY

N_BASE = JOINT_VELOCITY.start  # accelerations of the base
_HELD = 1e-6  # [1/kg] below it no joint holds a direction of a point: straight legs, points of one foot


class GiveWay(NamedTuple):
    """How the robot gives way where the commanded accelerations and the forces do not fit; both lie in one block."""

    E: np.ndarray  # (nv, 6) accelerations with that of the base, loaded points at rest
    inverse: np.ndarray  # (S_fb H E)⁻¹ (6, 6): the base's acceleration for a wrench that is missing
    block: np.ndarray  # what both lie in ((nv + 6) · 6,)


def blank_give_way(nv: int) -> GiveWay:
    """Return the memory for a robot with nv velocities."""
    return give_way_in(np.zeros((nv + N_BASE) * N_BASE))


@compiled
def give_way_in(block: np.ndarray) -> GiveWay:
    """Return what lies in a block."""
    nv = len(block) // N_BASE - N_BASE
    E, at = cut_rows(block, 0, nv, N_BASE)
    inverse, at = cut_rows(block, at, N_BASE, N_BASE)
    return GiveWay(E, inverse, block)


@compiled
def give_way(state: Configuration, contact: np.ndarray, give: GiveWay) -> None:
    """Write how the robot gives way while the points of ``contact`` ``(n_c,)`` bool stay at rest.

    The joints' part of E is −H_jj⁻¹ J_jᵀ (J_j H_jj⁻¹ J_jᵀ)⁻¹ J_b; without contact it is zero. With H = Lᵀ L it is
    H_jj = L_jjᵀ L_jj, and of T = J_j L_jj⁻¹ that part is −L_jj⁻¹ Tᵀ (T Tᵀ)⁻¹ J_b.
    """
    E, L, first = give.E, state.L, JOINT_VELOCITY.start
    n, rows = len(E) - first, 3 * np.count_nonzero(contact)
    for i in range(len(E)):
        for c in range(N_BASE):
            E[i, c] = 1.0 if i == c else 0.0
    if rows > 0:
        J_b, Tt = np.empty((rows, N_BASE)), np.empty((n, rows))
        row = 0
        for i in range(len(contact)):
            if contact[i]:
                for axis in range(3):
                    for c in range(N_BASE):
                        J_b[row, c] = state.J_contacts[i, axis, c]
                    for j in range(n):
                        Tt[j, row] = state.J_contacts[i, axis, first + j]
                    row += 1
        L_jj = np.empty((n, n))
        for i in range(n):
            for j in range(i + 1):
                L_jj[i, j] = L[first + i, first + j]
        upper_solve(L_jj, Tt)
        A = np.zeros((rows, rows))
        for k in range(rows):
            A[k, k] = _HELD
        for j in range(n):
            for i in range(rows):
                factor = Tt[j, i]
                if factor != 0.0:
                    for k in range(rows):
                        A[i, k] += factor * Tt[j, k]
        cholesky(A, A)
        cholesky_solve(A, J_b)
        moved = np.zeros((n, N_BASE))
        for j in range(n):
            for row in range(rows):
                factor = Tt[j, row]
                if factor != 0.0:
                    for c in range(N_BASE):
                        moved[j, c] -= factor * J_b[row, c]
        lower_solve(L_jj, moved)
        for j in range(n):
            for c in range(N_BASE):
                E[first + j, c] = moved[j, c]
    weight = np.zeros((N_BASE, N_BASE))
    for i in range(N_BASE):
        for k in range(len(E)):
            for c in range(N_BASE):
                weight[i, c] += state.M[i, k] * E[k, c]
    invert(weight, give.inverse)
