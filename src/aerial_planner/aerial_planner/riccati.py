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

from aerial_model.compiled import cholesky, compiled

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
            np.zeros((K + 1, y, y + 1)),  # stationarity of the eliminated controls
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
def _eliminate(
    M: np.ndarray,
    rows: np.ndarray,
    n: int,
    order: np.ndarray,
    k: int,
    ranks: np.ndarray,
    others: np.ndarray,
    stationarity: np.ndarray,
    gains: np.ndarray,
) -> tuple:
    """Remove the first ``n`` of the variables v of ½ [v; 1]ᵀ M [v; 1] s.t. rows [v; 1; ·] = 0.

    Returns:
        the cost of the others (with 1) in the form of M, and whether it has a minimum over those that the rows leave.
    """
    size = len(M)
    rank = _reduce(rows, n, order)
    ranks[k] = rank
    whole = np.arange(size)
    whole[:n] = order[:n]
    M = M[whole][:, whole]
    N = np.ascontiguousarray(rows[:rank, rank:size])
    M_12 = np.ascontiguousarray(M[:rank, rank:])
    R = np.ascontiguousarray(M[rank:, rank:])
    if rank > 0:
        Y = M_12 - np.dot(np.ascontiguousarray(M[:rank, :rank]), N)
        R = R - np.dot(np.ascontiguousarray(N.T), Y) - np.dot(np.ascontiguousarray(M_12.T), N)
        others[k, :rank, : size - rank] = N
        stationarity[k, :rank, : size - rank] = Y
    free = n - rank
    if free == 0:
        return R, True
    L = np.zeros((free, free))
    if not cholesky(R[:free, :free], L) > 0.0:
        return R, False
    V = np.ascontiguousarray(R[:free, free:])
    width = size - n
    for i in range(free):
        for j in range(i):
            for c in range(width):
                V[i, c] -= L[i, j] * V[j, c]
        scale = 1.0 / L[i, i]
        for c in range(width):
            V[i, c] *= scale
    P = np.ascontiguousarray(R[free:, free:]) - np.dot(np.ascontiguousarray(V.T), V)
    for i in range(free - 1, -1, -1):
        for j in range(i + 1, free):
            for c in range(width):
                V[i, c] -= L[j, i] * V[j, c]
        scale = 1.0 / L[i, i]
        for c in range(width):
            V[i, c] *= scale
    gains[k, :free, :width] = -V
    return P, True


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
    P, H, n_h, kept, T, ranks, orders, others, stationarity, gains = factor
    K = len(nx)
    for k in range(K - 1, -1, -1):
        x, u = nx[k], nu[k]
        y = x + u
        M = np.empty((y + 1, y + 1))
        M[:y, :y] = Q[k, :y, :y]
        M[:y, y] = q[k, :y]
        M[y, :y] = q[k, :y]
        M[y, y] = 0.0
        own, after = nc[k], n_h[k + 1] if k < K - 1 else 0
        m = own + after
        rows = np.zeros((m, y + 1 + m))
        rows[:own, :y] = C[k, :own, :y]
        rows[:own, y] = c[k, :own]
        for i in range(m):
            rows[i, y + 1 + i] = 1.0
        if k < K - 1:
            x_next = nx[k + 1]
            step = np.empty((x_next, y + 1))
            step[:, :y] = F[k, :x_next, :y]
            step[:, y] = f[k, :x_next]
            P_next = np.ascontiguousarray(P[k + 1, :x_next, :x_next])
            M += np.dot(np.ascontiguousarray(step.T), np.dot(P_next, step))
            lead = np.dot(np.ascontiguousarray(P[k + 1, :x_next, x_next]), step)
            M[:, y] += lead
            M[y, :] += lead
            if after > 0:
                rows[own:, : y + 1] = np.dot(np.ascontiguousarray(H[k + 1, :after, :x_next]), step)
                rows[own:, y] += H[k + 1, :after, x_next]
        order = np.arange(u)
        cost, bounded = _eliminate(M, rows, u, order, k, ranks, others, stationarity, gains)
        if not bounded:
            return False
        orders[k, :u] = order
        P[k, :x, : x + 1] = cost[:x]
        T[k, :m, :m] = rows[:, y + 1 :]
        # Rows without controls: those that say something are asked of the state.
        count = 0
        for i in range(ranks[k], m):
            largest = 0.0
            for j in range(u, y):
                largest = max(largest, abs(rows[i, j]))
            if largest > _RANK:
                H[k, count, : x + 1] = rows[i, u : y + 1]
                kept[k, count] = i
                count += 1
        n_h[k] = count
    # The first state: as controls of a stage before.
    x, m = nx[0], n_h[0]
    M = np.zeros((x + 1, x + 1))
    M[:x] = P[0, :x, : x + 1]
    M[x, :x] = P[0, :x, x]
    rows = np.zeros((m, x + 1 + m))
    rows[:, : x + 1] = H[0, :m, : x + 1]
    for i in range(m):
        rows[i, x + 1 + i] = 1.0
    order = np.arange(x)
    _, bounded = _eliminate(M, rows, x, order, K, ranks, others, stationarity, gains)
    orders[K, :x] = order
    T[K, :m, :m] = rows[:, x + 1 :]
    return bounded


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
    P, H, n_h, kept, T, ranks, orders, others, stationarity, gains = factor
    K = len(nx)
    one = np.ones(1)
    x, multipliers = _recover(one, nx[0], np.zeros(n_h[0]), K, ranks, orders, others, stationarity, gains, T)
    for k in range(K):
        m = nc[k] + (n_h[k + 1] if k < K - 1 else 0)
        reduced = np.zeros(m)
        for i in range(n_h[k]):
            reduced[kept[k, i]] = multipliers[i]
        u, of_rows = _recover(
            np.concatenate((x, one)), nu[k], reduced, k, ranks, orders, others, stationarity, gains, T
        )
        n_y = nu[k] + nx[k]
        y[k, : nu[k]] = u
        y[k, nu[k] : n_y] = x
        constraints[k, : nc[k]] = of_rows[: nc[k]]
        if k < K - 1:
            n = nx[k + 1]
            x = np.dot(np.ascontiguousarray(F[k, :n, :n_y]), y[k, :n_y]) + f[k, :n]
            multipliers = of_rows[nc[k] :]
            gradient = np.dot(np.ascontiguousarray(P[k + 1, :n, :n]), x) + P[k + 1, :n, n]
            for i in range(n_h[k + 1]):
                gradient += multipliers[i] * H[k + 1, i, :n]
            dynamics[k, :n] = -gradient


@compiled
def _recover(
    known: np.ndarray,
    n: int,
    reduced: np.ndarray,
    k: int,
    ranks: np.ndarray,
    orders: np.ndarray,
    others: np.ndarray,
    stationarity: np.ndarray,
    gains: np.ndarray,
    T: np.ndarray,
) -> tuple:
    """Return the ``n`` variables that stage ``k`` removed, and the multipliers of its rows."""
    rank = ranks[k]
    free = n - rank
    left = np.concatenate((np.dot(np.ascontiguousarray(gains[k, :free, : len(known)]), known), known))
    values = np.empty(n)
    for i in range(rank):
        values[orders[k, i]] = -np.dot(others[k, i, : len(left)], left)
        reduced[i] = -np.dot(stationarity[k, i, : len(left)], left)
    for i in range(free):
        values[orders[k, rank + i]] = left[i]
    m = len(reduced)
    return values, np.dot(np.ascontiguousarray(T[k, :m, :m].T), reduced)
