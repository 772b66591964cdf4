"""Linear-quadratic problems with equality constraints, stage by stage, solved exactly in time linear in their number.

    min  Σ_k ½ y_kᵀ Q_k y_k + q_kᵀ y_k ,   y_k = (u_k, x_k)
    s.t. x_k+1 = F_k y_k + f_k ,   C_k y_k + c_k = 0 .

This is a Newton step of an interior-point method. The recursion is Riccati's, extended to constraints as by Vanroye,
Sathya, De Schutter and Decré, *FATROP: A fast constrained optimal control problem solver*, IROS 2023: from the last stage
backward, rows that say something of the controls eliminate as many of them; what rows say of the state alone is handed to
the stage before. Products of dense matrices are BLAS's (through SciPy), those with F, which is sparse, loops: a knot of a
quadruped takes 0.03 ms.

Stages differ in size, so what belongs to them lies in arrays with a row for each that are as wide as the widest needs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerial_model.numerics.jit import compiled, reordered
from aerial_model.numerics.linalg import cholesky, lower_solve, upper_solve

_RANK = 1e-9  # a pivot smaller than this share of the largest coefficient is none


class LinearQuadratic:
    """The numbers of one problem, and memory for its solution.

    Args:
        nx: states of each stage ``(K,)``; the last one leads nowhere.
        nu: its controls.
        nc: its equality constraints.
        links: row and column of each nonzero of its F ``(n, 2)``; few, as Euler steps have.
    """

    def __init__(self, nx: np.ndarray, nu: np.ndarray, nc: np.ndarray, links: Sequence[np.ndarray]) -> None:
        self.nx, self.nu, self.nc = (np.array(n, dtype=np.int64) for n in (nx, nu, nc))
        K, x, c = len(nx), int(max(nx)), int(max(nc))
        y = int(max(self.nx + self.nu))
        self.Q, self.q = np.zeros((K, y, y)), np.zeros((K, y))
        self.n_links = np.array([len(pairs) for pairs in links], dtype=np.int64)
        self.links = np.zeros((K, max(self.n_links), 2), dtype=np.int64)
        for k, pairs in enumerate(links):
            self.links[k, : len(pairs)] = pairs
        self.F, self.f = np.zeros(self.links.shape[:2]), np.zeros((K, x))  # the nonzeros
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
        """Write the solution and the multipliers; return False if there is no minimum.

        That is, a direction has no curvature, or rows of the states alone pile up from stage to stage.
        """
        sizes = self.nx, self.nu, self.nc
        steps = self.n_links, self.links, self.F, self.f
        if not _backward(*sizes, *steps, self.Q, self.q, self.C, self.c, self._factor):
            return False
        _forward(*sizes, *steps, self.y, self.dynamics, self.constraints, self._factor)
        return True


@reordered
def _largest_row(rows: np.ndarray, first: int, end: int) -> tuple:
    """Return which row from ``first`` to ``end`` has the largest entry, and the size of that."""
    best, at = -1.0, first
    for i in range(first, end):
        size = 0.0
        for j in range(rows.shape[1]):
            entry = abs(rows[i, j])
            size = entry if entry > size else size
        if size > best:
            best, at = size, i
    return at, best


@compiled
def _reduce(U: np.ndarray, T: np.ndarray, order: np.ndarray) -> int:
    """Bring rows U ``(m, n)`` to [1 S; 0 0] by full pivoting, and the unit matrix T to what does that; return the rank.

    Columns change places, and ``order`` with them. With less than full pivoting errors grow from knot to knot.
    """
    m, n = U.shape
    for i in range(m - 1, -1, -1):
        if not np.any(U[i]):  # nothing to eliminate with: to the end
            m -= 1
            if i != m:
                for j in range(n):
                    U[i, j], U[m, j] = U[m, j], U[i, j]
                for j in range(len(T)):
                    T[i, j], T[m, j] = T[m, j], T[i, j]
    largest = 0.0
    for k in range(min(m, n)):
        at_row, best = _largest_row(U, k, m)
        largest = max(largest, best)
        if not best > _RANK * largest:
            return k
        at_column = k
        for j in range(n):
            if abs(U[at_row, j]) == best:
                at_column = j
                break
        if at_row != k:
            for j in range(n):
                U[k, j], U[at_row, j] = U[at_row, j], U[k, j]
            for j in range(len(T)):
                T[k, j], T[at_row, j] = T[at_row, j], T[k, j]
        if at_column != k:
            order[k], order[at_column] = order[at_column], order[k]
            for i in range(m):
                U[i, k], U[i, at_column] = U[i, at_column], U[i, k]
        pivot, pivot_T = U[k, k:], T[k]
        scale = 1.0 / pivot[0]
        for j in range(n - k):  # loops are vectorized if they start at 0
            pivot[j] *= scale
        for j in range(len(T)):
            pivot_T[j] *= scale
        for i in range(m):
            row, row_T = U[i, k:], T[i]
            factor = row[0]
            if i != k and factor != 0.0:
                for j in range(n - k):
                    row[j] -= factor * pivot[j]
                for j in range(len(T)):
                    row_T[j] -= factor * pivot_T[j]
    return min(m, n)


@compiled
def _add_cost_to_go(
    M: np.ndarray, P: np.ndarray, links: np.ndarray, F: np.ndarray, f: np.ndarray, place: np.ndarray
) -> None:
    """Add that of the next state, ½ [x; 1]ᵀ P [x; 1] with x = F y + f, to ½ [y; 1]ᵀ M [y; 1], y in the order ``place``."""
    x, y = len(P) - 1, len(M) - 1
    W = np.zeros((y + 1, x))  # of the slope by x, from [y; 1]
    for n in range(len(links)):
        i, j = links[n, 0], place[links[n, 1]]
        for a in range(x):
            W[j, a] += F[n] * P[i, a]
    for i in range(x + 1):
        factor = f[i] if i < x else 1.0
        for a in range(x):
            W[y, a] += factor * P[i, a]
    across = np.ascontiguousarray(W.T)
    for n in range(len(links)):
        i, j = links[n, 0], place[links[n, 1]]
        for a in range(y + 1):
            M[j, a] += F[n] * across[i, a]


@compiled
def _eliminate(M: np.ndarray, N: np.ndarray, Y: np.ndarray) -> None:
    """Let the first variables of ½ [y; 1]ᵀ M [y; 1] be −N times the others: what is left is M's last block, above its diagonal.

    Writes into Y what the slope by the first ones is, from the others.
    """
    rank, rest = N.shape
    if rank == 0:
        return
    first, Z = np.empty((rank, rank)), np.empty((rank, rest))
    for i in range(rank):
        for j in range(rank):
            first[i, j] = M[min(i, j), max(i, j)]
        row = M[i, rank:]
        for j in range(rest):
            Z[i, j] = row[j]
    half = np.dot(first, N)
    for i in range(rank):
        for j in range(rest):
            Y[i, j] = Z[i, j] - half[i, j]
            Z[i, j] -= 0.5 * half[i, j]
    twice = np.dot(N.T, Z)  # NᵀM₁₂ − ½ NᵀM₁₁N, which its transpose completes
    for i in range(rest):
        row, ahead = M[rank + i, rank + i :], twice[i, i:]
        for j in range(rest - i):
            row[j] -= ahead[j] + twice[i + j, i]


@compiled
def _minimized(M: np.ndarray, rank: int, free: int, gains: np.ndarray) -> tuple:
    """Return M's last block minimized over its first ``free`` variables, and whether it has a minimum.

    Writes into ``gains`` ``(free, ·)`` what these are, from the others.
    """
    first = rank + free
    left = len(M) - first
    A, L = np.empty((free, free)), np.zeros((free, free))
    for i in range(free):
        for j in range(i + 1):
            A[i, j] = M[rank + j, rank + i]
    cost = np.empty((left, left))
    if not cholesky(A, L) > 0.0:
        return cost, False
    for i in range(left):
        row = M[first + i, first:]
        for j in range(left):
            cost[i, j] = row[j]
    if free > 0:
        V = np.empty((free, left))
        for i in range(free):
            row = M[rank + i, first:]
            for j in range(left):
                V[i, j] = row[j]
        lower_solve(L, V)
        cost -= np.dot(V.T, V)
        upper_solve(L, V)
        for i in range(free):
            for a in range(left):
                gains[i, a] = -V[i, a]
    for i in range(left):
        for j in range(i):
            cost[i, j] = cost[j, i]
    return cost, True


@compiled
def _own_rows(C: np.ndarray, c: np.ndarray, U: np.ndarray, X: np.ndarray) -> None:
    """Write a stage's C (u, x) + c = 0 as the first rows of U u + X [x; 1] = 0."""
    u, x = U.shape[1], X.shape[1] - 1
    for i in range(len(c)):
        for j in range(u):
            U[i, j] = C[i, j]
        for j in range(x):
            X[i, j] = C[i, u + j]
        X[i, x] = c[i]


@compiled
def _asked_rows(
    H: np.ndarray, links: np.ndarray, F: np.ndarray, f: np.ndarray, own: int, U: np.ndarray, X: np.ndarray
) -> None:
    """Write what is asked of the next state, H [x; 1] = 0, as the rows of U u + X [x; 1] = 0 after the first ``own``."""
    u, x = U.shape[1], X.shape[1] - 1
    for i in range(len(U) - own):
        X[own + i, x] = H[i, len(f)]
        for n in range(len(links)):
            amount, j = H[i, links[n, 0]] * F[n], links[n, 1]
            if j < u:
                U[own + i, j] += amount
            else:
                X[own + i, j - u] += amount
        for j in range(len(f)):
            X[own + i, x] += H[i, j] * f[j]


@compiled
def _eliminated(U: np.ndarray, X: np.ndarray, rank: int) -> np.ndarray:
    """Return N ``(rank, ·)`` of reduced rows: the first controls are −N times the others, the state and one."""
    free, x = U.shape[1] - rank, X.shape[1]
    N = np.empty((rank, free + x))
    for i in range(rank):
        row, into = U[i, rank:], N[i, free:]
        for j in range(free):
            N[i, j] = row[j]
        for j in range(x):
            into[j] = X[i, j]
    return N


@compiled
def _own_cost(Q: np.ndarray, q: np.ndarray, u: int, place: np.ndarray) -> np.ndarray:
    """Return ½ yᵀ Q y + qᵀ y as a matrix of [y; 1], controls at their ``place``; only its upper triangle counts."""
    y = len(place) - 1
    M = np.zeros((y + 1, y + 1))
    for i in range(y):
        into, row = M[place[i]], Q[i]
        for j in range(u):
            into[place[j]] = row[j]
        into, row = into[u:], row[u:]
        for j in range(y - u):
            into[j] = row[j]
        into[y - u] = q[i]
    return M


@compiled
def _keep(A: np.ndarray, k: int, B: np.ndarray, rows: int) -> None:
    """Write the first ``rows`` of a matrix into block ``k`` of A, in a third of the time an assignment of slices takes."""
    for i in range(rows):
        for j in range(B.shape[1]):
            A[k, i, j] = B[i, j]


@compiled
def _hand_on(X: np.ndarray, rank: int, H: np.ndarray, kept: np.ndarray) -> int:
    """Write the rows after the first ``rank`` that say something of the state, and which these are; return how many.

    It is −1 if there are more than H has room for.
    """
    count, x = 0, X.shape[1] - 1
    for i in range(rank, len(X)):
        largest = 0.0
        for j in range(x):
            largest = max(largest, abs(X[i, j]))
        if largest > _RANK:
            if count == len(H):
                return -1
            for j in range(x + 1):
                H[count, j] = X[i, j]
            kept[count] = i
            count += 1
    return count


@compiled
def _backward(
    nx: np.ndarray,
    nu: np.ndarray,
    nc: np.ndarray,
    n_links: np.ndarray,
    all_links: np.ndarray,
    F: np.ndarray,
    f: np.ndarray,
    Q: np.ndarray,
    q: np.ndarray,
    C: np.ndarray,
    c: np.ndarray,
    factor: tuple,
) -> bool:
    """Fill ``factor`` from the last stage to the first; return whether there is a minimum."""
    P, H, n_h, kept, T, ranks, orders, others, slopes, gains = factor
    K = len(nx)
    to_go = np.zeros((1, 1))  # [x; 1] of the stage after
    itself = np.empty((nx[0], 2), dtype=np.int64)  # links of the step before the first
    itself[:, 0] = itself[:, 1] = np.arange(nx[0])
    for k in range(K - 1, -2, -1):
        # The first state is like controls of a stage before it, K as it were, that costs nothing by itself.
        first = k < 0
        at = K if first else k
        x, u, own = (0, nx[0], 0) if first else (nx[k], nu[k], nc[k])
        after, x_next = (n_h[k + 1], nx[k + 1]) if k + 1 < K else (0, 0)
        links = itself if first else all_links[k, : n_links[k]]
        steps, offset = (np.ones(u), np.zeros(u)) if first else (F[k], f[k, :x_next])
        m = own + after
        if m > T.shape[1]:
            return False  # rows of states pile up that no control can satisfy

        U, X, change = np.zeros((m, u)), np.zeros((m, x + 1)), np.eye(m)
        if own > 0:
            _own_rows(C[k], c[k, :own], U, X)
        if after > 0:
            _asked_rows(H[k + 1], links, steps, offset, own, U, X)
        order = np.arange(u)
        rank = _reduce(U, change, order)
        X = np.dot(change, X)
        N = _eliminated(U, X, rank)
        place = np.arange(u + x + 1)
        place[order] = np.arange(u)
        ranks[at], orders[at, :u] = rank, order
        _keep(T, at, change, m)
        _keep(others, at, N, rank)

        M = np.zeros((u + 1, u + 1)) if first else _own_cost(Q[k], q[k], u, place)
        if k + 1 < K:
            _add_cost_to_go(M, to_go, links, steps, offset, place)
        _eliminate(M, N, slopes[at, :rank, : N.shape[1]])
        to_go, bounded = _minimized(M, rank, u - rank, gains[at])
        if not bounded:
            return False
        if not first:
            _keep(P, k, to_go, x)
            n_h[k] = _hand_on(X, rank, H[k], kept[k])
            if n_h[k] < 0:
                return False
    return True


@reordered
def _add_product(
    A: np.ndarray, k: int, rows: int, columns: int, factor: float, v: np.ndarray, into: np.ndarray
) -> None:
    """Add the product of a block of ``A`` ``(K, ·, ·)`` with a vector, times ``factor``."""
    for i in range(rows):
        total = 0.0
        for j in range(columns):
            total += A[k, i, j] * v[j]
        into[i] += factor * total


@compiled
def _forward(
    nx: np.ndarray,
    nu: np.ndarray,
    nc: np.ndarray,
    n_links: np.ndarray,
    links: np.ndarray,
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
        n_x, rank = len(x), ranks[at]
        after = n_h[k + 1] if k + 1 < K else 0
        free, m, n_left = n_u - rank, own + after, n_u - rank + n_x + 1
        left = np.zeros(n_left)  # the controls that rows leave free, the state and one
        left[free : n_left - 1] = x
        left[n_left - 1] = 1.0
        _add_product(gains, at, free, n_x + 1, 1.0, left[free:], left)
        eliminated = np.zeros(rank)
        _add_product(others, at, rank, n_left, -1.0, left, eliminated)
        u = np.empty(n_u)
        for i in range(n_u):
            u[orders[at, i]] = eliminated[i] if i < rank else left[i - rank]
        reduced, of_rows = np.zeros(m), np.zeros(m)
        _add_product(slopes, at, rank, n_left, -1.0, left, reduced)
        if k >= 0:
            for i in range(n_h[k]):
                reduced[kept[k, i]] = pushes[i]
        for i in range(m):
            for j in range(m):
                of_rows[j] += T[at, i, j] * reduced[i]
        pushes = of_rows[own:]
        if k < 0:
            x = u
            continue
        y[k, :n_u] = u
        y[k, n_u : n_u + n_x] = x
        constraints[k, :own] = of_rows[:own]
        if k + 1 < K:
            n = nx[k + 1]
            x = np.ones(n + 1)
            x[:n] = f[k, :n]
            for i in range(n_links[k]):
                x[links[k, i, 0]] += F[k, i] * y[k, links[k, i, 1]]
            gradient = np.zeros(n)
            _add_product(P, k + 1, n, n + 1, 1.0, x, gradient)
            x = x[:n]
            for i in range(after):
                for j in range(n):
                    gradient[j] += pushes[i] * H[k + 1, i, j]
            dynamics[k, :n] = -gradient
