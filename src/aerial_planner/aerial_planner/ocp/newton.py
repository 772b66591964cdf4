"""The functions of a sequence of stage kinds, evaluated in shared memory, and the Newton steps they make.

Functions read and write NumPy's memory without copies: those of a kind are evaluated for consecutive knots at once, and
what they return, the nonzeros of their sparse matrices, is spread into dense blocks by compiled code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from aerial_model.numerics.jit import compiled
from aerial_planner.ocp.riccati import LinearQuadratic
from aerial_planner.ocp.stage import StageEvaluation, StageKind

_FEW = 8  # entries of a row, up to which its square is taken entry by entry


class StageSequence:
    """All knots of a problem: w = (x_0, u_0, x_1, u_1, …) in, values and derivatives out.

    Args:
        kinds: of each knot.
        evaluation_of: the functions of a kind.

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

    def __init__(self, kinds: Sequence[StageKind], evaluation_of: Callable[[StageKind], StageEvaluation]) -> None:
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
        knots = np.arange(len(kinds))
        of_rows = np.concatenate([np.repeat(knots, np.diff(self.step_0)), np.repeat(knots, np.diff(self.g_0))])
        self._by_knot = np.argsort(of_rows, kind="stable")  # of misses and constraints
        starts = [k for k in range(len(kinds)) if k == 0 or kinds[k] is not kinds[k - 1]]
        ends = [*starts[1:], len(kinds)]
        evaluations = [evaluation_of(kinds[k]) for k in starts]
        patterns = [_Pattern.of(kinds[k], evaluation) for k, evaluation in zip(starts, evaluations, strict=True)]
        self._tables = _Tables.of(patterns, np.subtract(ends, starts), self.z_0, self.nx, self.nu)
        self._F, self._G, self._H = (np.zeros(n[-1]) for n in (self._tables.F_0, self._tables.G_0, self._tables.H_0))
        self.links = [patterns[run].F_at for run in self._tables.run]  # where each knot's step has nonzeros
        self._values: list[Callable[[], object]] = []
        self._derivatives: list[Callable[[], object]] = []
        for start, end, evaluation in zip(starts, ends, evaluations, strict=True):
            self._bind(start, end, evaluation)

    def evaluate(self, w: np.ndarray) -> float:
        """Fill ``miss`` and ``g`` at w and return the cost."""
        self.w[:] = w
        for evaluate in self._values:
            evaluate()
        np.subtract(self.w[self.next_x], self.following, out=self.miss)
        return float(self.costs.sum())

    def differentiate(self) -> None:
        """Fill the gradients, and Jacobians and Hessians within, at the w evaluated last."""
        for evaluate in self._derivatives:
            evaluate()
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
            newton: to be written; of no other entries than these.
            q: gradient, as w, without the inequalities' share.
            diagonal: to be added to the Hessian's diagonal, as w.
            weights: of the squares of the inequalities' changes.
            pulls: the inequalities' gradients, to be added with their Jacobian.
            c: by how much the dynamics, the equalities and the fixed variables are missed.
            fixed: which variables are fixed.
        """
        _write(
            *(self._tables, self._F, self._G, self._H, q, diagonal, weights, pulls),
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
        change = np.zeros(len(self.lower))
        _change(self._tables, y, self._G, change)
        return change

    def constraints(self) -> np.ndarray:
        """Return misses of the dynamics and constraints, knot by knot."""
        return np.concatenate([self.miss, self.g])[self._by_knot]

    def _bind(self, start: int, end: int, functions: StageEvaluation) -> None:
        """Let the functions of a run of knots read and write this memory."""

        def part(row: np.ndarray, starts: np.ndarray) -> np.ndarray:
            return row[starts[start] : starts[end]]

        n, t = end - start, self._tables
        z, p = part(self.w, self.z_0), part(self.p, self.p_0)
        values = [self.costs[start:end], part(self.following, self.step_0), part(self.g, self.g_0)]
        self._values.append(functions.values.bind(n, [z, p], values))
        multipliers = [part(self.lam_x, self.step_0), part(self.lam_g, self.g_0)]
        F, G, H = (part(row, at) for row, at in ((self._F, t.F_0), (self._G, t.G_0), (self._H, t.H_0)))
        gradient, lagrangian = part(self.gradient, self.z_0), part(self.lagrangian, self.z_0)
        self._derivatives.append(functions.derivatives.bind(n, [z, p, *multipliers], [gradient, F, G, lagrangian, H]))


class _Pattern(NamedTuple):
    """Where the nonzeros of a kind's derivatives belong; variables in the order (u, x)."""

    F_at: np.ndarray  # row and column of each (n_F, 2)
    H_at: np.ndarray  # the same (n_H, 2)
    n_entries: int
    n_unequal: int
    # Of the constraints' Jacobian each entry's number in G, its row and its column (·, 3):
    equal: np.ndarray  # of equalities, rows numbered among these
    dense: np.ndarray  # of inequalities with many entries, rows numbered among these
    sparse: np.ndarray  # of those with few, row by row, rows numbered among all inequalities
    dense_rows: np.ndarray  # the numbers among all inequalities of those with many

    @staticmethod
    def of(kind: StageKind, functions: StageEvaluation) -> _Pattern:
        """Return that of a kind."""
        F_at, G_at, H_at = (functions.derivatives.nonzeros(i) for i in (1, 2, 4))
        n_x, n_u = kind.x.numel(), kind.u.numel()
        place = np.concatenate([n_u + np.arange(n_x), np.arange(n_u)]).astype(np.int64)
        F_at[:, 1], G_at[:, 1] = place[F_at[:, 1]], place[G_at[:, 1]]
        equal = kind.lower == kind.upper
        many = ~equal & (np.bincount(G_at[:, 0], minlength=len(equal)) > _FEW)
        few = ~equal & ~many

        def entries(rows: np.ndarray, among: np.ndarray) -> np.ndarray:
            number = np.cumsum(among) - 1
            chosen = np.flatnonzero(rows[G_at[:, 0]])
            table = np.column_stack([chosen, number[G_at[chosen, 0]], G_at[chosen, 1]])
            return table[np.argsort(table[:, 1], kind="stable")].astype(np.int64)

        return _Pattern(
            F_at=F_at,
            H_at=place[H_at],
            n_entries=len(G_at),
            n_unequal=int((~equal).sum()),
            equal=entries(equal, equal),
            dense=entries(many, many),
            sparse=entries(few, ~equal),
            dense_rows=np.flatnonzero(many[~equal]),
        )


class _Tables(NamedTuple):
    """The patterns of all runs of knots, one after the other, and where each knot's and each run's numbers start."""

    nx: np.ndarray  # (K,)
    nu: np.ndarray  # (K,)
    run: np.ndarray  # which one a knot belongs to (K,)
    z_0: np.ndarray  # (K+1,) in w
    F_0: np.ndarray
    G_0: np.ndarray
    H_0: np.ndarray
    unequal_0: np.ndarray  # among the inequalities
    H_at: np.ndarray
    equal: np.ndarray
    dense: np.ndarray
    sparse: np.ndarray
    dense_rows: np.ndarray
    H_at_0: np.ndarray  # (R+1,)
    equal_0: np.ndarray
    dense_0: np.ndarray
    sparse_0: np.ndarray
    dense_rows_0: np.ndarray

    @staticmethod
    def of(
        patterns: Sequence[_Pattern], lengths: np.ndarray, z_0: np.ndarray, nx: np.ndarray, nu: np.ndarray
    ) -> _Tables:
        """Return those of runs with these patterns, ``lengths`` knots each."""
        run = np.repeat(np.arange(len(patterns)), lengths)

        def starts(sizes: Sequence[int]) -> np.ndarray:
            return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

        def of_knots(sizes: Sequence[int]) -> np.ndarray:
            return starts(np.array(sizes)[run])

        names = ("H_at", "equal", "dense", "sparse", "dense_rows")
        tables = {name: [getattr(pattern, name) for pattern in patterns] for name in names}
        return _Tables(
            nx=nx,
            nu=nu,
            run=run,
            z_0=z_0,
            F_0=of_knots([len(pattern.F_at) for pattern in patterns]),
            G_0=of_knots([pattern.n_entries for pattern in patterns]),
            H_0=of_knots([len(pattern.H_at) for pattern in patterns]),
            unequal_0=of_knots([pattern.n_unequal for pattern in patterns]),
            **{name: np.concatenate(parts) for name, parts in tables.items()},
            **{f"{name}_0": starts([len(part) for part in parts]) for name, parts in tables.items()},
        )


@compiled
def _write(
    tables: _Tables,
    F: np.ndarray,
    G: np.ndarray,
    H: np.ndarray,
    gradient: np.ndarray,
    diagonal: np.ndarray,
    weights: np.ndarray,
    pulls: np.ndarray,
    Q_all: np.ndarray,
    q_all: np.ndarray,
    F_all: np.ndarray,
    C_all: np.ndarray,
) -> None:
    """Write all knots into a linear-quadratic problem's arrays, in the order (u, x)."""
    t = tables
    D = np.zeros((0, 1))
    for k in range(len(t.run)):
        r, nx, nu = t.run[k], t.nx[k], t.nu[k]
        ny, z_0 = nx + nu, t.z_0[k]
        F_k, G_k, H_k = F[t.F_0[k] : t.F_0[k + 1]], G[t.G_0[k] : t.G_0[k + 1]], H[t.H_0[k] : t.H_0[k + 1]]
        weight, pull = weights[t.unequal_0[k] :], pulls[t.unequal_0[k] :]
        for e in range(len(F_k)):
            F_all[k, e] = -F_k[e]
        for e in range(t.equal_0[r], t.equal_0[r + 1]):
            C_all[k, t.equal[e, 1], t.equal[e, 2]] = G_k[t.equal[e, 0]]
        rows = t.dense_rows[t.dense_rows_0[r] : t.dense_rows_0[r + 1]]
        if k == 0 or t.run[k - 1] != r:
            D = np.zeros((len(rows), ny + 1))
        root = np.sqrt(weight[rows])
        for i in range(len(rows)):
            D[i, ny] = pull[rows[i]] / root[i] if root[i] > 0.0 else 0.0
        dense = t.dense[t.dense_0[r] : t.dense_0[r + 1]]
        for e in range(len(dense)):
            D[dense[e, 1], dense[e, 2]] = root[dense[e, 1]] * G_k[dense[e, 0]]
        Q = np.dot(D.T, D)  # [Q q; qᵀ ·] of the inequalities with many entries
        sparse = t.sparse[t.sparse_0[r] : t.sparse_0[r + 1]]
        first = 0
        while first < len(sparse):
            row, end = sparse[first, 1], first
            while end < len(sparse) and sparse[end, 1] == row:
                end += 1
            for a in range(first, end):
                value, j = G_k[sparse[a, 0]], sparse[a, 2]
                Q[ny, j] += pull[row] * value
                for b in range(first, end):
                    Q[j, sparse[b, 2]] += weight[row] * value * G_k[sparse[b, 0]]
            first = end
        H_at = t.H_at[t.H_at_0[r] : t.H_at_0[r + 1]]
        for e in range(len(H_at)):
            Q[H_at[e, 0], H_at[e, 1]] += H_k[e]
        for j in range(nx):
            Q[nu + j, nu + j] += diagonal[z_0 + j]
            q_all[k, nu + j] = gradient[z_0 + j] + Q[ny, nu + j]
        for j in range(nu):
            Q[j, j] += diagonal[z_0 + nx + j]
            q_all[k, j] = gradient[z_0 + nx + j] + Q[ny, j]
        for a in range(ny):
            for b in range(ny):
                Q_all[k, a, b] = Q[a, b]


@compiled
def _change(tables: _Tables, y: np.ndarray, G: np.ndarray, change: np.ndarray) -> None:
    """Add G y of all inequalities."""
    t = tables
    for k in range(len(t.run)):
        r, first, G_k = t.run[k], t.unequal_0[k], G[t.G_0[k] :]
        for e in range(t.sparse_0[r], t.sparse_0[r + 1]):
            change[first + t.sparse[e, 1]] += G_k[t.sparse[e, 0]] * y[k, t.sparse[e, 2]]
        e, end = t.dense_0[r], t.dense_0[r + 1]
        while e < end:
            row, total = t.dense[e, 1], 0.0
            while e < end and t.dense[e, 1] == row:
                total += G_k[t.dense[e, 0]] * y[k, t.dense[e, 2]]
                e += 1
            change[first + t.dense_rows[t.dense_rows_0[r] + row]] = total


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
