"""The functions of a sequence of stage kinds, evaluated in shared memory, and the Newton steps they make.

CasADi's functions read and write NumPy's memory without copies: those of a kind are mapped over consecutive knots, and what
they return, the nonzeros of their sparse matrices, is spread into dense blocks by compiled code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import casadi as ca
import numpy as np

from aerial_model.compiled import compiled
from aerial_planner.in_place import InPlace
from aerial_planner.riccati import LinearQuadratic
from aerial_planner.stage import StageFunctions, StageKind


class StageSequence:
    """All knots of a problem: w = (x_0, u_0, x_1, u_1, …) in, values and derivatives out.

    Args:
        kinds: of each knot.
        functions_of: the functions of a kind.

    Attributes:
        p: parameters of all knots, to be written before ``evaluate``.
        miss: x_k+1 − next_k of all knots, in one row.
        g: constraints of all knots.
        lam_x: multipliers of ``miss``, to be written before ``differentiate``.
        lam_g: multipliers of ``g``.
        gradient: of the cost, as w.
        lagrangian: gradient of the Lagrangian, as w.
        equality: which of the constraints are equalities.
        equal_to: their values.
        lower: of the others; upper.
    """

    def __init__(self, kinds: Sequence[StageKind], functions_of: Callable[[StageKind], StageFunctions]) -> None:
        self.kinds = list(kinds)
        self.nx = np.array([kind.x.numel() for kind in kinds])
        self.nu = np.array([kind.u.numel() for kind in kinds])
        sizes = [(kind.z.numel(), kind.p.numel(), kind.constraints.numel(), kind.n_next) for kind in kinds]
        self.z_0, self.p_0, self.g_0, self.step_0 = np.vstack([np.zeros(4, np.int64), np.cumsum(sizes, axis=0)]).T
        lower, upper = (np.concatenate([getattr(kind, side) for kind in kinds]) for side in ("lower", "upper"))
        self.equality = lower == upper
        self.equal_to = lower[self.equality]
        self.lower, self.upper = lower[~self.equality], upper[~self.equality]
        self.n_equal = np.array([int((kind.lower == kind.upper).sum()) for kind in kinds])
        self.e_0 = np.concatenate([[0], np.cumsum(self.n_equal)])
        self.p, self.w, self.gradient, self.lagrangian = (np.zeros(n) for n in (self.p_0[-1], *[self.z_0[-1]] * 3))
        self.g, self.lam_g, self.following, self.lam_x = (
            np.zeros(n) for n in (*[self.g_0[-1]] * 2, *[self.step_0[-1]] * 2)
        )
        self.miss = np.zeros(self.step_0[-1])
        self.costs = np.zeros(len(kinds))
        following = [self.z_0[k + 1] + np.arange(kind.n_next) for k, kind in enumerate(kinds)]
        self.next_x = np.concatenate(following).astype(np.int64)  # where in w each row of ``miss`` has its state
        starts = [k for k in range(len(kinds)) if k == 0 or kinds[k] is not kinds[k - 1]]
        ends = [*starts[1:], len(kinds)]
        self._runs = [_Run(self, a, b, functions_of(kinds[a])) for a, b in zip(starts, ends, strict=True)]

    def evaluate(self, w: np.ndarray) -> float:
        """Fill ``miss`` and ``g`` at w and return the cost."""
        self.w[:] = w
        for run in self._runs:
            run.values.evaluate()
        np.subtract(self.w[self.next_x], self.following, out=self.miss)
        return float(self.costs.sum())

    def differentiate(self) -> None:
        """Fill the gradients, and Jacobians and Hessians within, at the w evaluated last."""
        for run in self._runs:
            for derivative in run.derivatives:
                derivative.evaluate()
        self.lagrangian[self.next_x] += self.lam_x

    def state(
        self,
        newton: LinearQuadratic,
        q: np.ndarray,
        diagonal: np.ndarray,
        weights: np.ndarray,
        pulls: np.ndarray,
        c: np.ndarray,
        fixed: np.ndarray,
    ) -> None:
        """Write a Newton step as a linear-quadratic problem.

        Args:
            newton: to be written.
            q: gradient, as w, without the inequalities' share.
            diagonal: to be added to the Hessian's diagonal, as w.
            weights: of the squares of the inequalities' changes.
            pulls: the inequalities' gradients, to be added with their Jacobian.
            c: by how much the dynamics, the equalities and the fixed variables are missed.
            fixed: which variables are fixed.
        """
        newton.C[:] = 0.0
        first = 0
        for run in self._runs:
            z = slice(self.z_0[run.start], self.z_0[run.start + run.n])
            of_run = slice(first, first + run.n * run.n_unequal)
            first = of_run.stop
            shape = (run.n, -1)
            _write(
                *(run.start, int(self.nx[run.start]), int(self.nu[run.start])),
                *(run.F, run.F_at, run.G, run.G_at, run.row, run.H, run.H_at),
                *(q[z].reshape(shape), diagonal[z].reshape(shape)),
                *(part[of_run].reshape(run.n, run.n_unequal) for part in (weights, pulls)),
                *(newton.Q, newton.q, newton.F, newton.C),
            )
        n_x, n_e = len(self.miss), int(self.e_0[-1])
        _scatter(c[:n_x], self.step_0, newton.f, -1.0)
        _scatter(c[n_x : n_x + n_e], self.e_0, newton.c, 1.0)
        for k, row, place, i in self._fixed_rows(fixed):
            newton.C[k, row, place], newton.c[k, row] = 1.0, c[n_x + n_e + i]

    def unpack(self, newton: LinearQuadratic, dw: np.ndarray, fixed: np.ndarray) -> np.ndarray:
        """Write the step of w, and return the multipliers of dynamics, equalities and fixed variables."""
        _unpack(newton.y, self.nx, self.nu, self.z_0, dw)
        n_x, n_e = len(self.miss), int(self.e_0[-1])
        lam = np.empty(n_x + n_e + len(fixed))
        _gather(newton.dynamics, self.step_0, lam[:n_x])
        _gather(newton.constraints, self.e_0, lam[n_x : n_x + n_e])
        for k, row, _, i in self._fixed_rows(fixed):
            lam[n_x + n_e + i] = newton.constraints[k, row]
        return lam

    def _fixed_rows(self, fixed: np.ndarray) -> Iterator[tuple[int, int, int, int]]:
        """Yield knot, row after its equalities, place in (u, x) and number of each fixed variable."""
        more = dict.fromkeys(range(len(self.kinds)), 0)
        for i, variable in enumerate(fixed):
            k = int(np.searchsorted(self.z_0, variable, side="right")) - 1
            place = (variable - self.z_0[k] + self.nu[k]) % (self.nx[k] + self.nu[k])
            yield k, int(self.n_equal[k]) + more[k], int(place), i
            more[k] += 1

    def equality_miss(self) -> np.ndarray:
        """Return by how much the equalities among the constraints are missed."""
        return self.g[self.equality] - self.equal_to

    def inequality_change(self, y: np.ndarray) -> np.ndarray:
        """Return the first-order change of the inequalities for steps y ``(K, ·)`` in (u, x) of each knot."""
        change = []
        for run in self._runs:
            of_run = np.zeros((run.n, run.n_unequal))
            _change(y[run.start : run.start + run.n], run.G, run.G_at, run.row, of_run)
            change.append(of_run.ravel())
        return np.concatenate(change)

    def constraints(self) -> np.ndarray:
        """Return misses of the dynamics and constraints, knot by knot."""
        knots = range(len(self.kinds))
        parts = [
            part[start[k] : start[k + 1]]
            for k in knots
            for part, start in ((self.miss, self.step_0), (self.g, self.g_0))
        ]
        return np.concatenate(parts)


class _Run:
    """Consecutive knots of one kind: its functions mapped over them, and the nonzeros that these write."""

    def __init__(self, sequence: StageSequence, start: int, end: int, functions: StageFunctions) -> None:
        s, kind, n = sequence, sequence.kinds[start], end - start
        self.start, self.n = start, n

        def part(row: np.ndarray, starts: np.ndarray) -> np.ndarray:
            return row[starts[start] : starts[end]]

        z, p = part(s.w, s.z_0), part(s.p, s.p_0)
        following, g = part(s.following, s.step_0), part(s.g, s.g_0)
        gradient, lagrangian = part(s.gradient, s.z_0), part(s.lagrangian, s.z_0)
        multipliers = [np.ones(n), part(s.lam_x, s.step_0), part(s.lam_g, s.g_0)]
        of_F, of_G = (functions.jacobian.sparsity_out(i) for i in (0, 1))
        of_H = functions.hessian.sparsity_out(1)
        self.F, self.G, self.H = (np.zeros((n, sparsity.nnz())) for sparsity in (of_F, of_G, of_H))
        self.F_at, self.G_at, self.H_at = (_entries(sparsity) for sparsity in (of_F, of_G, of_H))
        n_x, n_u = kind.x.numel(), kind.u.numel()
        place = np.concatenate([n_u + np.arange(n_x), np.arange(n_u)])  # of a variable in (u, x)
        self.H_at[:] = place[self.H_at]
        self.F_at[:, 1], self.G_at[:, 1] = place[self.F_at[:, 1]], place[self.G_at[:, 1]]
        equal = kind.lower == kind.upper
        self.n_equal, self.n_unequal = int(equal.sum()), int((~equal).sum())
        # Of each constraint its number among the equalities, or −1 less that among the inequalities.
        self.row = np.where(equal, np.cumsum(equal) - 1, -np.cumsum(~equal)).astype(np.int64)
        self.values = InPlace(functions.values, n, [z, p], [s.costs[start:end], following, g])
        self.derivatives = (
            InPlace(functions.gradient, n, [z, p], [gradient]),
            InPlace(functions.jacobian, n, [z, p], [self.F, self.G]),
            InPlace(functions.hessian, n, [z, p, *multipliers], [lagrangian, self.H]),
        )


def _entries(sparsity: ca.Sparsity) -> np.ndarray:
    """Return row and column of each nonzero ``(nnz, 2)``."""
    return np.column_stack([sparsity.row(), sparsity.get_col()]).astype(np.int64).reshape(-1, 2)


@compiled
def _write(
    start: int,
    nx: int,
    nu: int,
    F: np.ndarray,
    F_at: np.ndarray,
    G: np.ndarray,
    G_at: np.ndarray,
    row: np.ndarray,
    H: np.ndarray,
    H_at: np.ndarray,
    gradient: np.ndarray,
    diagonal: np.ndarray,
    weights: np.ndarray,
    pulls: np.ndarray,
    Q_all: np.ndarray,
    q_all: np.ndarray,
    F_all: np.ndarray,
    C_all: np.ndarray,
) -> None:
    """Write the knots of one run into a linear-quadratic problem's arrays, in the order (u, x)."""
    n, ny, n_unequal = len(F), nx + nu, weights.shape[1]
    D = np.empty((n_unequal, ny))
    for i in range(n):
        k = start + i
        q = q_all[k]
        for j in range(ny):
            q[j] = gradient[i, nx + j] if j < nu else gradient[i, j - nu]
        F_k = F_all[k]
        F_k[:, :ny] = 0.0
        for e in range(len(F_at)):
            F_k[F_at[e, 0], F_at[e, 1]] = -F[i, e]
        D[:] = 0.0
        for e in range(len(G_at)):
            r, c = row[G_at[e, 0]], G_at[e, 1]
            if r >= 0:
                C_all[k, r, c] = G[i, e]
            else:
                q[c] += pulls[i, -1 - r] * G[i, e]
                D[-1 - r, c] = np.sqrt(weights[i, -1 - r]) * G[i, e]
        Q = np.dot(D.T, D)
        for e in range(len(H_at)):
            Q[H_at[e, 0], H_at[e, 1]] += H[i, e]
        for j in range(ny):
            Q[j, j] += diagonal[i, nx + j] if j < nu else diagonal[i, j - nu]
        Q_all[k, :ny, :ny] = Q


@compiled
def _change(y: np.ndarray, G: np.ndarray, G_at: np.ndarray, row: np.ndarray, change: np.ndarray) -> None:
    for i in range(len(G)):
        for e in range(len(G_at)):
            r = row[G_at[e, 0]]
            if r < 0:
                change[i, -1 - r] += G[i, e] * y[i, G_at[e, 1]]


@compiled
def _scatter(values: np.ndarray, starts: np.ndarray, into: np.ndarray, factor: float) -> None:
    """Write the parts of a row that begin at ``starts`` into the rows of a matrix, times ``factor``."""
    for k in range(len(starts) - 1):
        for i in range(starts[k + 1] - starts[k]):
            into[k, i] = factor * values[starts[k] + i]


@compiled
def _gather(values: np.ndarray, starts: np.ndarray, into: np.ndarray) -> None:
    """Write the rows of a matrix into the parts of a row that begin at ``starts``."""
    for k in range(len(starts) - 1):
        for i in range(starts[k + 1] - starts[k]):
            into[starts[k] + i] = values[k, i]


@compiled
def _unpack(y: np.ndarray, nx: np.ndarray, nu: np.ndarray, starts: np.ndarray, into: np.ndarray) -> None:
    """Write the steps (u, x) of all knots as one row (x_0, u_0, x_1, …)."""
    for k in range(len(nx)):
        for i in range(nx[k]):
            into[starts[k] + i] = y[k, nu[k] + i]
        for i in range(nu[k]):
            into[starts[k] + nx[k] + i] = y[k, i]
