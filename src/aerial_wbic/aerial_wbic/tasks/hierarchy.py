"""Tasks in strict priority: the acceleration that meets the first task, then as much of the next as is left, and so on.

Next to it, for comparison, all tasks at once with weights.

Null-space projection with dynamically consistent inverses, thesis (3.20)–(3.23), in coordinates in which the mass matrix is
the identity: with H = Lᵀ L and ẍ = J q̈ = (J L⁻¹) (L q̈), the dynamically consistent inverse is the ordinary one, and what a
task owns is spanned by rows of length one, Q. The task below it is left with J L⁻¹ (1 − Qᵀ Q).

What is left of a task under those above it may have any rank, zero included. Two absolute thresholds tell what it is: a
relative one would take the rounding noise of an exhausted J N for a task and make accelerations of 1e13. What is left but
hardly moves (arms that hang straight down cannot turn a body about the vertical) is moved by a damped inverse: the less, the
less it can do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.numerics.jit import compiled, reordered
from aerial_model.numerics.linalg import cholesky, cholesky_solve, lower_solve, upper_solve

# Of eigenvalues of J H⁻¹ Jᵀ, inverse inertias.
MOVABLE = 0.01  # share of the robot's as a whole: a direction that moves that little does half of what is asked
NOISE = 1e-9  # [1/kg] a direction below it is left to lower tasks
_CERTAIN = 10.0  # times as movable: damping would change a hundredth
EFFORT = 1e-3  # ε of weighted tasks [1/kg]: settles what none of them asks for, and hardly weighs on what they do


class Task(NamedTuple):
    """One physical statement about a task coordinate x with ẋ = J q̇: its acceleration and its velocity.

    The velocity is not needed for the acceleration; it tells which way the joints are about to move.
    """

    J: np.ndarray  # (m, nv)
    a: np.ndarray  # ẍ_cmd − J̇ q̇ (m,)
    xdot: np.ndarray  # ẋ_ref (m,)


class NullSpaceRecursion(NamedTuple):
    """What tasks so far ask for, and what they leave to those below; as they are made, nothing and all."""

    L: np.ndarray  # lower triangular (nv, nv) with H = Lᵀ L
    command: np.ndarray  # rows L q̈_cmd, L q̇_ref (2, nv)
    Q: np.ndarray  # (nv, nv): its first rows span what tasks own


@compiled
def no_tasks(L: np.ndarray) -> NullSpaceRecursion:
    """Return the recursion before its first task, for a robot with H = Lᵀ L."""
    return NullSpaceRecursion(L, np.zeros((2, len(L))), np.empty_like(L))


@compiled
def add_by_null_space(above: NullSpaceRecursion, owned: int, task: Task) -> int:
    """Add the next task by null-space projection, thesis (3.23): it uses what the first ``owned`` rows of Q leave.

    It may have no rows. Return how many rows are owned with it.
    """
    L, command, Q = above
    m, nv = len(task.a), len(L)
    if m == 0 or owned == nv:
        return owned
    columns, rows = np.empty((nv, m)), np.empty((m, nv + 2))
    for i in range(m):
        for k in range(nv):
            columns[k, i] = task.J[i, k]
    upper_solve(L, columns)  # (J L⁻¹)ᵀ
    for i in range(m):
        for k in range(nv):
            rows[i, k] = columns[k, i]
        rows[i, nv], rows[i, nv + 1] = task.a[i], task.xdot[i]
    _subtract_commanded(rows, command)
    _project(rows, Q, owned)
    rank = owned_rows(rows, MOVABLE / L[0, 0] ** 2)
    for row in range(rank):
        for k in range(nv):
            command[0, k] += rows[row, k] * rows[row, nv]
            command[1, k] += rows[row, k] * rows[row, nv + 1]
    rank = min(rank, nv - owned)
    for row in range(rank):
        for k in range(nv):
            Q[owned + row, k] = rows[row, k]
    return owned + rank


@compiled
def least_energy_solution(tasks: NullSpaceRecursion, vdot: np.ndarray, v_ref: np.ndarray) -> None:
    """Write q̈_cmd and q̇_ref ``(nv,)`` of tasks in falling priority, the same for both.

    Of those that do equally well they are the ones of least kinetic energy, the least in the metric of H.
    """
    L = tasks.L
    for i in range(len(vdot)):
        vdot[i], v_ref[i] = tasks.command[0, i], tasks.command[1, i]
        for j in range(i):
            if L[i, j] != 0.0:
                vdot[i] -= L[i, j] * vdot[j]
                v_ref[i] -= L[i, j] * v_ref[j]
        vdot[i] /= L[i, i]
        v_ref[i] /= L[i, i]


class NormalEquations(NamedTuple):
    """Normal equations of weighted least squares: min Σ w_i ‖J_i q̈ − a_i‖² + ε q̈ᵀ H q̈, the same for q̇_ref."""

    A: np.ndarray  # (nv, nv)
    b: np.ndarray  # columns of q̈_cmd, q̇_ref (nv, 2)


@compiled
def no_equations(M: np.ndarray) -> NormalEquations:
    """Return the equations of no task yet, for a robot with mass matrix H ``(nv, nv)``."""
    return NormalEquations(EFFORT * M, np.zeros((len(M), 2)))


@compiled
def add_weighted(equations: NormalEquations, task: Task, weight: float) -> None:
    """Add a task, with its weight, to the normal equations; it may have no rows."""
    Jt = weight * task.J.T
    equations.A[:] += Jt @ task.J
    equations.b[:, 0] += Jt @ task.a
    equations.b[:, 1] += Jt @ task.xdot


@compiled
def weighted_solution(equations: NormalEquations, vdot: np.ndarray, v_ref: np.ndarray) -> None:
    """Write q̈_cmd and q̇_ref ``(nv,)`` that solve the weighted least squares."""
    L = np.empty_like(equations.A)
    cholesky(equations.A, L)
    cholesky_solve(L, equations.b)
    vdot[:], v_ref[:] = equations.b[:, 0], equations.b[:, 1]


@reordered
def _subtract_commanded(rows: np.ndarray, command: np.ndarray) -> None:
    """Take from what rows are to do, their last two numbers, what is commanded already."""
    nv = command.shape[1]
    for i in range(len(rows)):
        acceleration = velocity = 0.0
        for k in range(nv):
            acceleration += rows[i, k] * command[0, k]
            velocity += rows[i, k] * command[1, k]
        rows[i, nv] -= acceleration
        rows[i, nv + 1] -= velocity


@reordered
def _project(rows: np.ndarray, Q: np.ndarray, owned: int) -> None:
    """Take from rows ``(m, nv or more)`` what lies in the span of the first rows of Q ``(nv, nv)``, which are orthonormal."""
    nv, along = len(Q), np.empty(owned)
    for i in range(len(rows)):
        for row in range(owned):
            inner = 0.0
            for k in range(nv):
                inner += rows[i, k] * Q[row, k]
            along[row] = inner
        for row in range(owned):
            part = along[row]
            for k in range(nv):
                rows[i, k] -= part * Q[row, k]


@reordered
def _gram(rows: np.ndarray, nv: int, A: np.ndarray) -> None:
    """Write the inner products ``(m, m)`` of rows, of their first nv numbers."""
    for i in range(len(rows)):
        for j in range(i + 1):
            inner = 0.0
            for k in range(nv):
                inner += rows[i, k] * rows[j, k]
            A[i, j] = A[j, i] = inner


@compiled
def owned_rows(rows: np.ndarray, enough: float) -> int:
    """Replace rows by ones of length one that span them, and what they are to do by what these are to do.

    Args:
        rows: ``(m, nv + 2)``, in coordinates in which the mass matrix is the identity; the last two numbers are what a row
            is to do. Only the first are left, as many as are returned.
        enough: inverse inertia [1/kg] at which a direction does half of what it is asked for.

    Returns:
        The number of directions owned. As a rule it is m, and all can be moved. It is 0 if a row is not finite.
    """
    m, nv = len(rows), rows.shape[1] - 2
    A, L = np.empty((m, m)), np.empty((m, m))
    _gram(rows, nv, A)
    if cholesky(A, L) > _CERTAIN * enough:  # every row adds to those before
        lower_solve(L, rows)
        return m
    if not np.isfinite(A).all():  # it would raise
        return 0
    eigenvalues, U = np.linalg.eigh(A)
    turned = np.ascontiguousarray(U.T) @ rows
    rank = 0
    for i, eigenvalue in enumerate(eigenvalues):
        if eigenvalue > NOISE:
            root = np.sqrt(eigenvalue)
            for k in range(nv):
                rows[rank, k] = turned[i, k] / root
            for k in range(nv, nv + 2):
                rows[rank, k] = turned[i, k] * root * eigenvalue / (eigenvalue**2 + enough**2)
            rank += 1
    return rank
