"""Solvers of the controller's quadratic program, all of which take it in the same form.

    min ½ (yᵀ y + xᵀ x)   s.t.   lower ≤ A [y; x] ≤ upper

with y = √Q_1 δ_q in the first six columns and x = √Q_2 δ_f in the others; the first six rows are equations, [I  −G] [y; x] = g.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import daqp
import numpy as np
import osqp
from scipy import sparse

from aerial_model.compiled import compiled
from aerial_wbic.gains import QpSolver

N_BASE = 6  # rows of the equations of motion of the base
INFINITY = osqp.constant("OSQP_INFTY")
_SETTINGS = {
    "verbose": False,
    "scaling": 0,  # done here
    "adaptive_rho": False,
    "alpha": 1.2,
    "eps_abs": 1e-4,
    "eps_rel": 1e-5,
    "check_termination": 5,
    "warm_starting": True,
    "polishing": False,
}
# The penalty was found on recorded motions: it takes 15 iterations in the median and 20 to 30 at the 99th percentile, of a
# quadruped's jump, roll and flip as of a humanoid's jump, spin and flip. What is far from what the ground can give takes
# hundreds; an active-set method is faster there.
_PENALTY = {"rho": 0.2, "max_iter": 150}
_DAQP_SOLVED = 1
_ACCEPTED = (osqp.SolverStatus.OSQP_SOLVED, osqp.SolverStatus.OSQP_SOLVED_INACCURATE)


class QpMinimizer(Protocol):
    """What solves the problems of one sparsity."""

    def minimum(self, A: sparse.csc_matrix, lower: np.ndarray, upper: np.ndarray) -> np.ndarray | None:
        """Return x ``(3 n,)`` at the optimum, which the caller checks to be finite; None if none is found."""


QpFactory = Callable[[sparse.csc_matrix, np.ndarray, np.ndarray], QpMinimizer]  # of a first problem of the sparsity


class Osqp:
    """OSQP, set up once for all problems of one sparsity; each starts from the solution of the last.

    Its penalty does not adapt to what it met before, so that equal input gives equal output to the last bit. What it has
    not solved in time is left to DAQP.
    """

    def __init__(self, A: sparse.csc_matrix, lower: np.ndarray, upper: np.ndarray) -> None:
        rows, variables = A.shape
        self._nothing = np.zeros(variables), np.zeros(rows)
        self._solver = osqp.OSQP()
        P = sparse.eye(variables, format="csc")
        self._solver.setup(P, self._nothing[0], A, lower, upper, **_SETTINGS, **_PENALTY)
        self._second = Daqp(A, lower, upper)
        reduced(A.data, A.indices, A.indptr, lower, upper)  # compiles what no tick may
        self._core = self._solver._solver  # OSQP itself: the wrapper's bookkeeping takes longer than the solution

    def minimum(self, A: sparse.csc_matrix, lower: np.ndarray, upper: np.ndarray) -> np.ndarray | None:
        """Return √Q_2 δ_f; None if DAQP, the second to try, finds none either."""
        self._core.update_data_vec(q=None, l=lower, u=upper)
        self._core.update_data_mat(P_x=None, P_i=None, A_x=A.data, A_i=None)
        x = self._attempt()
        if x is not None:
            return x[N_BASE:]
        x, y = self._nothing
        self._solver.warm_start(x=x, y=y)
        return self._second.minimum(A, lower, upper)

    def _attempt(self) -> np.ndarray | None:
        """Return the variables that OSQP finds; None if it gives up."""
        self._core.solve()
        return self._core.solution.x if self._core.info.status_val in _ACCEPTED else None


class Daqp:
    """DAQP, an active-set method, on the problem of x alone; every problem from nothing."""

    def __init__(self, A: sparse.csc_matrix, lower: np.ndarray, upper: np.ndarray) -> None:
        self._sense = np.zeros(len(lower) - N_BASE, dtype=np.int32)  # inequalities

    def minimum(self, A: sparse.csc_matrix, lower: np.ndarray, upper: np.ndarray) -> np.ndarray | None:
        """Return √Q_2 δ_f; None if DAQP finds none, or the problem is not finite."""
        problem = reduced(A.data, A.indices, A.indptr, lower, upper)
        if not np.isfinite(problem.f).all():  # it would not end
            return None
        x, _, status, _ = daqp.solve(*problem, self._sense)
        return x if status == _DAQP_SOLVED else None


class Reduced(NamedTuple):
    """min ½ xᵀ H x + fᵀ x  s.t. lower ≤ A x ≤ upper, in the order in which DAQP takes it."""

    H: np.ndarray  # (3 n, 3 n)
    f: np.ndarray  # (3 n,)
    A: np.ndarray  # (m, 3 n)
    upper: np.ndarray  # (m,)
    lower: np.ndarray  # (m,)


@compiled
def reduced(data: np.ndarray, indices: np.ndarray, indptr: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> Reduced:
    """Return the problem of x = √Q_2 δ_f; the first six rows of A say y = √Q_1 δ_q = G x + g.

    Args:
        data: entries of A by columns.
        indices: their rows.
        indptr: where each column begins, and the end.
        lower: least values of A's rows; the first six are equations.
        upper: greatest values.
    """
    rows, n = len(lower) - N_BASE, len(indptr) - 1 - N_BASE
    G, A_y = np.zeros((N_BASE, n)), np.zeros((rows, N_BASE))
    A, H, f = np.zeros((rows, n)), np.eye(n), np.zeros(n)
    above, below = upper[N_BASE:].copy(), lower[N_BASE:].copy()
    for column in range(N_BASE + n):
        for entry in range(indptr[column], indptr[column + 1]):
            row = indices[entry]
            if column < N_BASE and row >= N_BASE:
                A_y[row - N_BASE, column] = data[entry]
                above[row - N_BASE] -= data[entry] * lower[column]
                below[row - N_BASE] -= data[entry] * lower[column]
            elif column >= N_BASE and row < N_BASE:
                G[row, column - N_BASE] = -data[entry]
                f[column - N_BASE] -= data[entry] * lower[row]
            elif column >= N_BASE:
                A[row - N_BASE, column - N_BASE] = data[entry]
    for i in range(n):
        for j in range(n):
            for k in range(N_BASE):
                H[i, j] += G[k, i] * G[k, j]
    for row in range(rows):
        for k in range(N_BASE):
            if A_y[row, k] != 0.0:
                for j in range(n):
                    A[row, j] += A_y[row, k] * G[k, j]
    return Reduced(H, f, A, above, below)


SOLVERS: dict[QpSolver, QpFactory] = {QpSolver.OSQP: Osqp, QpSolver.DAQP: Daqp}
