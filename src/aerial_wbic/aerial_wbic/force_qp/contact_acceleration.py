"""The joints' accelerations with which the base accelerates while loaded contact points stay at rest.

That is E of q̈ = q̈_cmd + E δ_q in (3.24), where the thesis has [1; 0]; see ``optimization`` for why.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.kinematics import Configuration
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.layout import Layout
from aerial_model.numerics.linalg import cholesky, cholesky_solve, invert, lower_solve, upper_solve
from aerial_model.robot.robot import JOINT_VELOCITY

N_BASE = JOINT_VELOCITY.start  # accelerations of the base
_HELD = 1e-6  # [1/kg] below it no joint holds a direction of a point: straight legs, points of one foot


class ContactAcceleration(NamedTuple):
    """How the robot accelerates beside what is commanded, consistent with its contacts; both lie in one block."""

    E: np.ndarray  # (nv, 6) accelerations with that of the base, loaded points at rest
    inverse: np.ndarray  # (S_fb H E)⁻¹ (6, 6): the base's acceleration for a wrench that is missing
    block: np.ndarray  # what both lie in


CONTACT_ACCELERATION = Layout(sizes=("nv",), arrays={"E": ("nv", N_BASE), "inverse": (N_BASE, N_BASE)})
contact_acceleration_in = CONTACT_ACCELERATION.reader(ContactAcceleration)


def blank_contact_acceleration(nv: int) -> ContactAcceleration:
    """Return the memory for a robot with nv velocities."""
    return contact_acceleration_in(CONTACT_ACCELERATION.block(nv=nv))


@compiled
def write_contact_acceleration(state: Configuration, contact: np.ndarray, result: ContactAcceleration) -> None:
    """Write E and (S_fb H E)⁻¹ for a robot on the points of ``contact`` ``(n_c,)`` bool; without contact the joints' part is zero."""
    E = result.E
    for i in range(len(E)):
        for c in range(N_BASE):
            E[i, c] = 1.0 if i == c else 0.0
    if contact.any():
        _write_joint_rows(state, contact, E)
    weight = np.zeros((N_BASE, N_BASE))
    for i in range(N_BASE):
        for k in range(len(E)):
            for c in range(N_BASE):
                weight[i, c] += state.M[i, k] * E[k, c]
    invert(weight, result.inverse)


@compiled
def _write_joint_rows(state: Configuration, contact: np.ndarray, E: np.ndarray) -> None:
    """Write the joints' part of E, −H_jj⁻¹ J_jᵀ (J_j H_jj⁻¹ J_jᵀ)⁻¹ J_b.

    With H = Lᵀ L it is H_jj = L_jjᵀ L_jj, and of T = J_j L_jj⁻¹ that part is −L_jj⁻¹ Tᵀ (T Tᵀ)⁻¹ J_b.
    """
    first, n, rows = JOINT_VELOCITY.start, len(E) - JOINT_VELOCITY.start, 3 * np.count_nonzero(contact)
    L_jj, J_b, Tt = np.empty((n, n)), np.empty((rows, N_BASE)), np.empty((n, rows))
    for i in range(n):
        for j in range(i + 1):
            L_jj[i, j] = state.L[first + i, first + j]
    _write_jacobians(state, contact, J_b, Tt)
    upper_solve(L_jj, Tt)
    _solve_for_contacts(Tt, J_b)
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


@compiled
def _write_jacobians(state: Configuration, contact: np.ndarray, J_b: np.ndarray, Jt_j: np.ndarray) -> None:
    """Write the loaded points' Jacobian: J_b ``(3 n, 6)`` of the base, J_jᵀ ``(n_joints, 3 n)`` of the joints."""
    row = 0
    for i in range(len(contact)):
        if contact[i]:
            for axis in range(3):
                for c in range(N_BASE):
                    J_b[row, c] = state.J_contacts[i, axis, c]
                for j in range(len(Jt_j)):
                    Jt_j[j, row] = state.J_contacts[i, axis, N_BASE + j]
                row += 1


@compiled
def _solve_for_contacts(Tt: np.ndarray, J_b: np.ndarray) -> None:
    """Write (T Tᵀ)⁻¹ J_b over J_b; Tt is Tᵀ."""
    rows = len(J_b)
    A = np.zeros((rows, rows))
    for k in range(rows):
        A[k, k] = _HELD
    for j in range(len(Tt)):
        for i in range(rows):
            factor = Tt[j, i]
            if factor != 0.0:
                for k in range(rows):
                    A[i, k] += factor * Tt[j, k]
    cholesky(A, A)
    cholesky_solve(A, J_b)
