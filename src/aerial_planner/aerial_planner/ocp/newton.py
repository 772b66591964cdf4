"""The Newton steps of a barrier problem, as linear-quadratic problems of its stages.

    min  ½ dwᵀ (∇²L + Δ) dw + qᵀ dw + ½ (J dw)ᵀ Σ (J dw) + bᵀ J dw   s.t.  A dw + c = 0

L: Lagrangian, J: Jacobian of the inequalities, Σ and b: what the barrier contributes to the Hessian and the gradient by each of
them, A: Jacobian of dynamics and equalities, with a row of the identity for each fixed variable.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.numerics.jit import compiled
from aerial_planner.ocp.ragged import from_rows, part, starts_of, to_rows
from aerial_planner.ocp.riccati import Coefficients, LinearQuadratic
from aerial_planner.ocp.sequence import StageSequence
from aerial_planner.ocp.sparsity import Derivatives, Tables


class Terms(NamedTuple):
    """What an iteration adds to the stages' derivatives."""

    gradient: np.ndarray  # (n_w,) q
    diagonal: np.ndarray  # (n_w,) Δ
    weight: np.ndarray  # (n_unequal,) Σ of each inequality
    slope: np.ndarray  # (n_unequal,) b of each inequality


class NewtonSystem:
    """The linear-quadratic problem that is the Newton step of a sequence of stages.

    Args:
        stages: evaluated and differentiated where the step begins.
        fixed: which variables of w are fixed, ascending.
    """

    def __init__(self, stages: StageSequence, fixed: np.ndarray) -> None:
        self._stages = stages
        stage = np.searchsorted(stages.w.starts, fixed, side="right") - 1
        place = (fixed - stages.w.starts[stage] + stages.nu[stage]) % (stages.nx[stage] + stages.nu[stage])  # in (u, x)
        n_fixed = np.bincount(stage, minlength=len(stages.nx))
        row = stages.n_equal[stage] + np.arange(len(fixed)) - starts_of(n_fixed)[stage]  # after the stage's equalities
        self._fixed = stage, row
        self._equal_starts = starts_of(stages.n_equal)
        self._problem = LinearQuadratic(stages.nx, stages.nu, stages.n_equal + n_fixed, stages.links)
        self._problem.coefficients.C[stage, row, place] = 1.0

    def write(self, terms: Terms, c: np.ndarray) -> None:
        """Write the step's problem.

        Args:
            terms: added to the stages' derivatives.
            c: by how much the dynamics, the equalities and the fixed variables are missed, in this order.
        """
        stages, coefficients = self._stages, self._problem.coefficients
        _write(stages.tables, stages.derivatives, terms, coefficients)
        n_x, n_e = stages.miss.starts[-1], self._equal_starts[-1]
        to_rows(c[:n_x], stages.miss.starts, coefficients.f, -1.0)
        to_rows(c[n_x : n_x + n_e], self._equal_starts, coefficients.c, 1.0)
        coefficients.c[self._fixed] = c[n_x + n_e :]

    def solve(self) -> bool:
        """Solve the step's problem; return False if it has no minimum, see ``LinearQuadratic.solve``."""
        return self._problem.solve()

    def add_to_diagonal(self, value: float) -> None:
        """Add a multiple of the identity to the Hessian."""
        self._problem.add_to_diagonal(value)

    def step(self) -> np.ndarray:
        """Return the step dw ``(n_w,)`` that was solved for."""
        stages = self._stages
        dw = np.empty(stages.w.starts[-1])
        _unpack(self._problem.optimum.y, stages.nx, stages.nu, stages.w.starts, dw)
        return dw

    def multipliers(self) -> np.ndarray:
        """Return the multipliers of dynamics, equalities and fixed variables after the step, as ``c`` of ``write``."""
        starts, optimum = self._stages.miss.starts, self._problem.optimum
        n_x, n_e = starts[-1], self._equal_starts[-1]
        lam = np.empty(n_x + n_e + len(self._fixed[0]))
        from_rows(optimum.dynamics, starts, lam[:n_x])
        from_rows(optimum.constraints, self._equal_starts, lam[n_x : n_x + n_e])
        lam[n_x + n_e :] = optimum.constraints[self._fixed]
        return lam

    def inequality_change(self) -> np.ndarray:
        """Return the first-order change J dw of the inequalities along the step ``(n_unequal,)``."""
        stages = self._stages
        change = np.zeros(len(stages.lower))
        _change(stages.tables, stages.derivatives, self._problem.optimum.y, change)
        return change


@compiled
def _write(tables: Tables, derivatives: Derivatives, terms: Terms, coefficients: Coefficients) -> None:
    """Write the matrices of all stages, in the order y = (u, x)."""
    D = np.zeros((0, 1))
    for k in range(len(tables.run)):
        r, n_y = tables.run[k], tables.nx[k] + tables.nu[k]
        first, end = tables.unequal_starts[k], tables.unequal_starts[k + 1]
        weight, slope = terms.weight[first:end], terms.slope[first:end]
        G, rows = part(derivatives.G, k), part(tables.dense_rows, r)
        _write_jacobians(part(derivatives.F, k), G, part(tables.equal, r), coefficients.F[k], coefficients.C[k])
        if k == 0 or tables.run[k - 1] != r:
            D = np.zeros((len(rows), n_y + 1))
        _scale(G, part(tables.dense, r), weight[rows], slope[rows], D)
        Q = np.dot(D.T, D)  # [Q q; qᵀ ·] of the inequalities with many entries
        _add_squares(G, part(tables.sparse, r), weight, slope, Q)
        _add_entries(part(derivatives.H, k), part(tables.H_at, r), Q)
        at = slice(tables.z_starts[k], tables.z_starts[k + 1])
        _write_cost(Q, terms.gradient[at], terms.diagonal[at], tables.nu[k], coefficients.Q[k], coefficients.q[k])


@compiled
def _write_jacobians(F: np.ndarray, G: np.ndarray, equal: np.ndarray, into_F: np.ndarray, into_C: np.ndarray) -> None:
    """Write the nonzeros of a stage's ∂next/∂y, and the dense Jacobian of its equalities."""
    for e in range(len(F)):
        into_F[e] = -F[e]
    for e in range(len(equal)):
        into_C[equal[e, 1], equal[e, 2]] = G[equal[e, 0]]


@compiled
def _scale(G: np.ndarray, dense: np.ndarray, weight: np.ndarray, slope: np.ndarray, D: np.ndarray) -> None:
    """Write D = [√Σ J, b / √Σ] of the inequalities with many entries: DᵀD is what they add to the Hessian and gradient."""
    root = np.sqrt(weight)
    n_y = D.shape[1] - 1
    for i in range(len(D)):
        D[i, n_y] = slope[i] / root[i] if root[i] > 0.0 else 0.0
    for e in range(len(dense)):
        D[dense[e, 1], dense[e, 2]] = root[dense[e, 1]] * G[dense[e, 0]]


@compiled
def _add_squares(G: np.ndarray, sparse: np.ndarray, weight: np.ndarray, slope: np.ndarray, Q: np.ndarray) -> None:
    """Add what the inequalities with few entries contribute to [Q q; qᵀ ·], entry by entry."""
    n_y, first = len(Q) - 1, 0
    while first < len(sparse):
        row, end = sparse[first, 1], first
        while end < len(sparse) and sparse[end, 1] == row:
            end += 1
        for a in range(first, end):
            value, j = G[sparse[a, 0]], sparse[a, 2]
            Q[n_y, j] += slope[row] * value
            for b in range(first, end):
                Q[j, sparse[b, 2]] += weight[row] * value * G[sparse[b, 0]]
        first = end


@compiled
def _add_entries(H: np.ndarray, H_at: np.ndarray, Q: np.ndarray) -> None:
    for e in range(len(H_at)):
        Q[H_at[e, 0], H_at[e, 1]] += H[e]


@compiled
def _write_cost(
    Q: np.ndarray, gradient: np.ndarray, diagonal: np.ndarray, n_u: int, into_Q: np.ndarray, into_q: np.ndarray
) -> None:
    """Write Hessian and gradient of a stage's cost, from [Q q; qᵀ ·] in the order (u, x) and what is added as (x, u)."""
    n_y = len(gradient)
    n_x = n_y - n_u
    for j in range(n_x):
        Q[n_u + j, n_u + j] += diagonal[j]
        into_q[n_u + j] = gradient[j] + Q[n_y, n_u + j]
    for j in range(n_u):
        Q[j, j] += diagonal[n_x + j]
        into_q[j] = gradient[n_x + j] + Q[n_y, j]
    for a in range(n_y):
        for b in range(n_y):
            into_Q[a, b] = Q[a, b]


@compiled
def _change(tables: Tables, derivatives: Derivatives, y: np.ndarray, change: np.ndarray) -> None:
    """Write J y of all inequalities; ``change`` is zero before."""
    for k in range(len(tables.run)):
        r, first, G = tables.run[k], tables.unequal_starts[k], part(derivatives.G, k)
        sparse, dense, dense_rows = part(tables.sparse, r), part(tables.dense, r), part(tables.dense_rows, r)
        for e in range(len(sparse)):
            change[first + sparse[e, 1]] += G[sparse[e, 0]] * y[k, sparse[e, 2]]
        e = 0
        while e < len(dense):
            row, total = dense[e, 1], 0.0
            while e < len(dense) and dense[e, 1] == row:
                total += G[dense[e, 0]] * y[k, dense[e, 2]]
                e += 1
            change[first + dense_rows[row]] = total


@compiled
def _unpack(y: np.ndarray, nx: np.ndarray, nu: np.ndarray, starts: np.ndarray, into: np.ndarray) -> None:
    """Write the steps (u, x) of all stages as one row (x_0, u_0, x_1, …)."""
    for k in range(len(nx)):
        for i in range(nx[k]):
            into[starts[k] + i] = y[k, nu[k] + i]
        for i in range(nu[k]):
            into[starts[k] + nx[k] + i] = y[k, i]
