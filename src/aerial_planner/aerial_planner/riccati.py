"""Linear-quadratic problems with equality constraints, stage by stage, solved exactly in time linear in their number.

    min  Σ_k ½ y_kᵀ Q_k y_k + q_kᵀ y_k ,   y_k = (u_k, x_k)
    s.t. x_k+1 = F_k y_k + f_k ,   C_k y_k + c_k = 0 .

This is a Newton step of an interior-point method. The recursion is Riccati's, extended to constraints as by Vanroye,
Sathya, De Schutter and Decré, *FATROP: A fast constrained optimal control problem solver*, IROS 2023: from the last stage
backward, rows that say something of the controls eliminate as many of them; what rows say of the state alone is handed to
the stage before. Products of matrices are BLAS's (through SciPy), which is what makes it fast: a knot of a quadruped
takes 0.05 ms.

Stages differ in size, so what belongs to them lies in arrays with a row for each that are as wide as the widest needs.
"""

from __future__ import annotations

import numpy as np

from aerial_model.compiled import cholesky, cholesky_solve, compiled

_RANK = 1e-9  # a pivot smaller than this share of the largest coefficient is none


class LinearQuadratic:
    """The numbers of one problem, and memory for its solution.

    Args:
        nx: states of each stage ``(K,)``; the last one leads nowhere.
        nu: its controls.
        nc: its equality constraints.
    """

    def __init__(self, nx: np.ndarray, nu: np.ndarray, nc: np.ndarray) -> None:
        self.nx, self.nu, self.nc = (np.array(n, dtype=np.int64) for n in (nx, nu, nc))
        K, x, c = len(nx), int(max(nx)), int(max(nc))
        y = int(max(self.nx + self.nu))
        self.Q, self.q = np.zeros((K, y, y)), np.zeros((K, y))
        self.F, self.f = np.zeros((K, x, y)), np.zeros((K, x))
        self.C, self.c = np.zeros((K, c, y)), np.zeros((K, c))
        self.y = np.zeros((K, y))  # solution
        self.dynamics = np.zeros((K, x))  # multipliers of x_k+1 − F_k y_k − f_k = 0
        self.constraints = np.zeros((K, c))  # multipliers of C_k y_k + c_k = 0
        rows = c + x  # of a stage: its own and those of the state after it
        self._factor = (
            np.zeros((K, x, x + 1)),  # P, p: the cost to go
            np.zeros((K + 1, rows, x + 1)),  # H, h: what is asked of the state
            np.zeros(K + 1, dtype=np.int64),  # how many rows that has
            np.zeros((K + 1, rows), dtype=np.int64),  # which of the stage's rows they are
            np.zeros((K + 1, rows, rows)),  # T: from the stage's rows to the reduced ones
            np.zeros(K + 1, dtype=np.int64),  # how many controls the rows eliminate; of stage K: initial states
            np.zeros((K + 1, y), dtype=np.int64),  # the order of the controls, those eliminated first
            np.zeros((K + 1, y, y + 1)),  # eliminated controls from the others, the state and one
            np.zeros((K + 1, y, y + 1)),  # slope of a stage's own cost by these, from the same
            np.zeros((K + 1, y, x + 1)),  # the other controls from the state and one
        )

    def add_to_diagonal(self, value: float) -> None:
        """Add to the curvature of every variable."""
        every = np.arange(self.Q.shape[1])
        self.Q[:, every, every] += value

    def solve(self) -> bool:
        """Write the solution and the multipliers; return False if there is no minimum: a direction has no curvature."""
        sizes = self.nx, self.nu, self.nc
        if not _backward(*sizes, self.Q, self.q, self.F, self.f, self.C, self.c, self._factor):
            return False
        _forward(*sizes, self.F, self.f, self.y, self.dynamics, self.constraints, self._factor)
        return True


@compiled
def _reduce(rows: np.ndarray, n: int, order: np.ndarray) -> int:
    """Bring the first ``n`` columns of ``rows`` to [1 S; 0 0] by full pivoting; return the rank.

    Columns change places, and ``order`` with them.
    """
    m, width = rows.shape
    least = 0.0
    for i in range(m):
        for j in range(n):
            least = max(least, abs(rows[i, j]))
    least *= _RANK
    for k in range(min(m, n)):
        best, at_row, at_column = least, -1, -1
        for i in range(k, m):
            for j in range(k, n):
                if abs(rows[i, j]) > best:
                    best, at_row, at_column = abs(rows[i, j]), i, j
        if at_row < 0:
            return k
        if at_row != k:
            for j in range(width):
                rows[k, j], rows[at_row, j] = rows[at_row, j], rows[k, j]
        if at_column != k:
            order[k], order[at_column] = order[at_column], order[k]
            for i in range(m):
                rows[i, k], rows[i, at_column] = rows[i, at_column], rows[i, k]
        scale = 1.0 / rows[k, k]
        for j in range(k, width):
            rows[k, j] *= scale
        for i in range(m):
            factor = rows[i, k]
            if i != k and factor != 0.0:
                for j in range(k, width):
                    rows[i, j] -= factor * rows[k, j]
    return min(m, n)


@compiled
def _reduced(Q: np.ndarray, N: np.ndarray, rank: int, Y: np.ndarray) -> np.ndarray:
    """Return ½ [v; 1]ᵀ Q [v; 1] as a matrix of the variables after the first ``rank``, which are −N times these.

    Writes into Y ``(rank, ·)`` what the gradient by the first ones is, from the others.
    """
    R = np.ascontiguousarray(Q[rank:, rank:])
    if rank > 0:
        Q_12 = np.ascontiguousarray(Q[:rank, rank:])
        Y[:] = Q_12 - np.dot(np.ascontiguousarray(Q[:rank, :rank]), N)
        R -= np.dot(N.T, np.ascontiguousarray(Y)) + np.dot(Q_12.T, N)
    return R


@compiled
def _minimized(R: np.ndarray, free: int, gains: np.ndarray) -> tuple:
    """Return ½ [v; 1]ᵀ R [v; 1] minimized over the first ``free`` variables, and whether it has a minimum.

    Writes into ``gains`` ``(free, ·)`` what these are, from the others.
    """
    if free == 0:
        return R, True
    L = np.zeros((free, free))
    if not cholesky(R[:free, :free], L) > 0.0:
        return R, False
    R_12 = np.ascontiguousarray(R[:free, free:])
    V = R_12.copy()
    cholesky_solve(L, V)
    gains[:free, : V.shape[1]] = -V
    return np.ascontiguousarray(R[free:, free:]) - np.dot(R_12.T, V), True


@compiled
def _conditions(C: np.ndarray, c: np.ndarray, H: np.ndarray, h: np.ndarray, step: np.ndarray, width: int) -> np.ndarray:
    """Return what a stage's variables must satisfy, rows [·, 1] = 0, and beside each which row it is.

    These are its own C y + c = 0 and, through the step to the next state, H x + h = 0.
    """
    own, after = len(C), len(H)
    rows = np.zeros((own + after, width + own + after))
    rows[:own, : width - 1] = C
    rows[:own, width - 1] = c
    if after > 0:
        rows[own:, :width] = np.dot(H, step)
        rows[own:, width - 1] += h
    for i in range(own + after):
        rows[i, width + i] = 1.0
    return rows


@compiled
def _add_cost_to_go(R: np.ndarray, P: np.ndarray, step: np.ndarray, order: np.ndarray, N: np.ndarray) -> None:
    """Add that of the next state, [P p], which the variables left reach by ``step`` with the first ones −N times these."""
    x, rank, rest = len(P), len(N), len(R)
    ordered = np.empty((x, rank + rest))
    for i in range(x):
        for j in range(rank + rest):
            ordered[i, j] = step[i, order[j]]
    reached = np.ascontiguousarray(ordered[:, rank:])
    if rank > 0:
        reached -= np.dot(np.ascontiguousarray(ordered[:, :rank]), N)
    R += np.dot(reached.T, np.dot(np.ascontiguousarray(P[:, :x]), reached))
    lead = np.dot(np.ascontiguousarray(P[:, x]), reached)
    R[:, rest - 1] += lead
    R[rest - 1, :] += lead


@compiled
def _backward(
    nx: np.ndarray,
    nu: np.ndarray,
    nc: np.ndarray,
    Q: np.ndarray,
    q: np.ndarray,
    F: np.ndarray,
    f: np.ndarray,
    C: np.ndarray,
    c: np.ndarray,
    factor: tuple,
) -> bool:
    """Fill ``factor`` from the last stage to the first; return whether there is a minimum."""
    P, H, n_h, kept, T, ranks, orders, others, slopes, gains = factor
    K = len(nx)
    for k in range(K - 1, -2, -1):
        # The first state is like controls of a stage before it, K as it were, that costs nothing by itself.
        at = k if k >= 0 else K
        x, u, own = (nx[k], nu[k], nc[k]) if k >= 0 else (0, nx[0], 0)
        y, follows = x + u, 0 <= k + 1 < K
        after = n_h[k + 1] if follows else 0
        x_next = nx[k + 1] if follows else 0
        step = np.zeros((x_next, y + 1))
        if k < 0:
            for i in range(u):
                step[i, i] = 1.0
        elif follows:
            step[:, :y] = F[k, :x_next, :y]
            step[:, y] = f[k, :x_next]
        m = own + after
        ahead = H[k + 1, :after, : x_next + 1] if follows else np.zeros((0, 1))
        rows = _conditions(
            C[max(k, 0), :own, :y],
            c[max(k, 0), :own],
            np.ascontiguousarray(ahead[:, :x_next]),
            ahead[:, x_next],
            step,
            y + 1,
        )
        order = np.arange(y + 1)
        rank = _reduce(rows, u, order)
        ranks[at] = rank
        orders[at, :u] = order[:u]
        T[at, :m, :m] = rows[:, y + 1 :]
        rest = y + 1 - rank
        N = np.ascontiguousarray(rows[:rank, rank : y + 1])
        others[at, :rank, :rest] = N

        M = np.zeros((y + 1, y + 1))
        if k >= 0:
            for i in range(y):
                for j in range(y):
                    M[i, j] = Q[k, order[i], order[j]]
                M[i, y] = M[y, i] = q[k, order[i]]
        R = _reduced(M, N, rank, slopes[at, :rank, :rest])
        if follows:
            _add_cost_to_go(R, P[k + 1, :x_next, : x_next + 1], step, order, N)
        cost, bounded = _minimized(R, u - rank, gains[at])
        if not bounded:
            return False
        if k < 0:
            break
        # Rounding would double an asymmetry at every stage.
        P[k, :x, :x] = 0.5 * (cost[:x, :x] + cost[:x, :x].T)
        P[k, :x, x] = cost[:x, x]
        # Rows without controls: those that say something are asked of the state.
        count = 0
        for i in range(rank, m):
            if np.max(np.abs(rows[i, u:y])) > _RANK:
                H[k, count, : x + 1] = rows[i, u : y + 1]
                kept[k, count] = i
                count += 1
        n_h[k] = count
    return True


@compiled
def _forward(
    nx: np.ndarray,
    nu: np.ndarray,
    nc: np.ndarray,
    F: np.ndarray,
    f: np.ndarray,
    y: np.ndarray,
    dynamics: np.ndarray,
    constraints: np.ndarray,
    factor: tuple,
) -> None:
    """Write solution and multipliers from the first stage to the last."""
    P, H, n_h, kept, T, ranks, orders, others, slopes, gains = factor
    K = len(nx)
    x, pushes = np.zeros(0), np.zeros(0)  # the state, and the multipliers of what is asked of it
    for k in range(-1, K):
        at = k if k >= 0 else K
        n_u, own = (nu[k], nc[k]) if k >= 0 else (nx[0], 0)
        rank, follows = ranks[at], k + 1 < K
        after = n_h[k + 1] if follows else 0
        known = np.append(x, 1.0)
        free = np.dot(np.ascontiguousarray(gains[at, : n_u - rank, : len(known)]), known)
        left = np.concatenate((free, known))
        u = np.empty(n_u)
        for i in range(rank):
            u[orders[at, i]] = -np.dot(others[at, i, : len(left)], left)
        for i in range(n_u - rank):
            u[orders[at, rank + i]] = free[i]
        gradient = np.zeros(0)
        if k >= 0:
            y[k, :n_u] = u
            y[k, n_u : n_u + len(x)] = x
        if follows:
            n = nx[k + 1]
            n_y = n_u + len(x)
            x = np.dot(np.ascontiguousarray(F[k, :n, :n_y]), y[k, :n_y]) + f[k, :n] if k >= 0 else u
            gradient = np.dot(np.ascontiguousarray(P[k + 1, :n, :n]), x) + P[k + 1, :n, n]
        reduced = np.zeros(own + after)
        for i in range(rank):
            reduced[i] = -np.dot(slopes[at, i, : len(left)], left)
            for j in range(len(gradient)):
                reduced[i] -= gradient[j] * (F[k, j, orders[at, i]] if k >= 0 else 1.0 * (j == orders[at, i]))
        if k >= 0:
            for i in range(n_h[k]):
                reduced[kept[k, i]] = pushes[i]
        m = own + after
        of_rows = np.dot(np.ascontiguousarray(T[at, :m, :m].T), reduced)
        if k >= 0:
            constraints[k, :own] = of_rows[:own]
        pushes = of_rows[own:]
        if follows and k >= 0:
            for i in range(after):
                gradient += pushes[i] * H[k + 1, i, : len(gradient)]
            dynamics[k, : len(gradient)] = -gradient
