"""Dense algebra of one stage of the Riccati recursion: constraints eliminate controls, the others minimize the cost.

Matrices are small, a few dozen rows: loops that start at 0, over rows of one array, are what LLVM makes vector code of.
"""

from __future__ import annotations

import numpy as np

from aerial_model.numerics.jit import compiled, reordered
from aerial_model.numerics.linalg import cholesky, lower_solve, upper_solve

_RANK = 1e-9  # a pivot smaller than this share of the largest coefficient is none


@compiled
def write_constraints(C: np.ndarray, c: np.ndarray, U: np.ndarray, X: np.ndarray) -> None:
    """Write a stage's constraints C (u, x) + c = 0 as the first rows of U u + X [x; 1] = 0."""
    u, x = U.shape[1], X.shape[1] - 1
    for i in range(len(c)):
        for j in range(u):
            U[i, j] = C[i, j]
        for j in range(x):
            X[i, j] = C[i, u + j]
        X[i, x] = c[i]


@compiled
def write_next_constraints(
    H: np.ndarray, links: np.ndarray, F: np.ndarray, f: np.ndarray, U: np.ndarray, X: np.ndarray
) -> None:
    """Write the constraint-to-go of the next state, H [F y + f; 1] = 0, as rows U u + X [x; 1] = 0.

    Args:
        H: constraint-to-go ``(·, n_x' + 1)``, as many rows as U has.
        links: row and column of each nonzero of F ``(n_F, 2)``.
        F: the nonzeros ``(n_F,)``.
        f: offset of the next state ``(n_x',)``.
        U: written, zero before ``(m, n_u)``.
        X: written, zero before ``(m, n_x + 1)``.
    """
    u, x = U.shape[1], X.shape[1] - 1
    for i in range(len(U)):
        X[i, x] = H[i, len(f)]
        for n in range(len(links)):
            amount, j = H[i, links[n, 0]] * F[n], links[n, 1]
            if j < u:
                U[i, j] += amount
            else:
                X[i, j - u] += amount
        for j in range(len(f)):
            X[i, x] += H[i, j] * f[j]


@compiled
def reduce_rows(U: np.ndarray, T: np.ndarray, order: np.ndarray) -> int:
    """Bring rows U to [1 S; 0 0] by Gauss–Jordan elimination with full pivoting; return the rank.

    With less than full pivoting errors grow from stage to stage.

    Args:
        U: rows ``(m, n)``, changed; their columns change places.
        T: the identity ``(m, m)``; becomes the matrix that U is multiplied with, but for its columns' places.
        order: 0 to n − 1; becomes the original place of each column.
    """
    m: int = _zero_rows_to_end(U, T)
    n: int = U.shape[1]
    largest = 0.0
    for k in range(min(m, n)):
        row, size = _largest_row(U, k, m)
        largest = max(largest, size)
        if not size > _RANK * largest:
            return k
        if row != k:
            _swap_rows(U, k, row)
            _swap_rows(T, k, row)
        column = _place_of(size, U[k], k)
        if column != k:
            order[k], order[column] = order[column], order[k]
            for i in range(m):
                U[i, k], U[i, column] = U[i, column], U[i, k]
        _clear_column(U, T, k, m)
    return min(m, n)


@compiled
def _zero_rows_to_end(U: np.ndarray, T: np.ndarray) -> int:
    """Move the rows of U that are zero, there is nothing to eliminate with them, to the end; return how many others there are."""
    m = len(U)
    for i in range(m - 1, -1, -1):
        if not np.any(U[i]):
            m -= 1
            if i != m:
                _swap_rows(U, i, m)
                _swap_rows(T, i, m)
    return m


@compiled
def _swap_rows(A: np.ndarray, i: int, j: int) -> None:
    for n in range(A.shape[1]):
        A[i, n], A[j, n] = A[j, n], A[i, n]


@compiled
def _place_of(size: float, row: np.ndarray, otherwise: int) -> int:
    """Return the first place of a row's entry of this size."""
    for j in range(len(row)):
        if abs(row[j]) == size:
            return j
    return otherwise


@compiled
def _clear_column(U: np.ndarray, T: np.ndarray, k: int, m: int) -> None:
    """Scale row ``k`` to a pivot of 1, and subtract it from the first ``m`` others such that they have 0 in column ``k``."""
    pivot, pivot_T = U[k, k:], T[k]
    scale = 1.0 / pivot[0]
    for j in range(len(pivot)):
        pivot[j] *= scale
    for j in range(len(pivot_T)):
        pivot_T[j] *= scale
    for i in range(m):
        row, row_T = U[i, k:], T[i]
        factor = row[0]
        if i != k and factor != 0.0:
            for j in range(len(pivot)):
                row[j] -= factor * pivot[j]
            for j in range(len(pivot_T)):
                row_T[j] -= factor * pivot_T[j]


@reordered
def _largest_row(rows: np.ndarray, first: int, end: int) -> tuple[int, float]:
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
def solved_for_first(U: np.ndarray, X: np.ndarray, rank: int) -> np.ndarray:
    """Return N ``(rank, ·)`` of reduced rows U u + X [x; 1] = 0: the first controls are −N (the other controls, x, 1)."""
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
def constraint_to_go(X: np.ndarray, rank: int, H: np.ndarray, kept: np.ndarray) -> int:
    """Write the reduced rows that constrain the state alone; return how many, −1 if there are more than H has rows.

    Args:
        X: reduced rows X [x; 1], of which the first ``rank`` determine controls ``(m, n_x + 1)``.
        rank: number of these.
        H: written ``(·, ≥ n_x + 1)``.
        kept: written, which rows of X those of H are.
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
def quadratic(Q: np.ndarray, q: np.ndarray, u: int, place: np.ndarray) -> np.ndarray:
    """Return the matrix M of ½ [y; 1]ᵀ M [y; 1] = ½ yᵀ Q y + qᵀ y; only its upper triangle counts.

    Args:
        Q: Hessian ``(≥ n_y, ≥ n_y)``, y = (u, x).
        q: gradient at 0 ``(≥ n_y,)``.
        u: number of controls.
        place: where each entry of (u, x, 1) stands in M ``(n_y + 1,)``; only controls change places.
    """
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
def add_cost_to_go(
    M: np.ndarray, P: np.ndarray, links: np.ndarray, F: np.ndarray, f: np.ndarray, place: np.ndarray
) -> None:
    """Add the cost-to-go of the next state x = F y + f, ½ [x; 1]ᵀ P [x; 1], to ½ [y; 1]ᵀ M [y; 1].

    Args:
        M: changed ``(n_y + 1, n_y + 1)``.
        P: cost-to-go ``(n_x + 1, n_x + 1)``.
        links: row and column of each nonzero of F ``(n_F, 2)``.
        F: the nonzeros ``(n_F,)``.
        f: offset of the next state ``(n_x,)``.
        place: where each entry of (y, 1) stands in M ``(n_y + 1,)``.
    """
    x, y = len(P) - 1, len(M) - 1
    W = np.zeros((y + 1, x))  # [y; 1] ↦ gradient by x, transposed
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
def substitute(M: np.ndarray, N: np.ndarray, Y: np.ndarray) -> None:
    """Eliminate the first variables of ½ [y; 1]ᵀ M [y; 1], which are −N times the others; M's last block becomes theirs.

    Args:
        M: changed above the diagonal of its last block.
        N: ``(rank, rest)``.
        Y: written, the others ↦ gradient by the first ones ``(rank, rest)``.
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
def minimize(M: np.ndarray, rank: int, free: int, gains: np.ndarray) -> tuple[np.ndarray, bool]:
    """Return what is left of ½ [y; 1]ᵀ M [y; 1] minimized over ``free`` variables, and whether there is a minimum.

    Args:
        M: matrix, of which only the upper triangle counts.
        rank: the variables before the free ones, which have been substituted.
        free: number of variables to minimize over.
        gains: written, the variables after the free ones and one ↦ the free ones ``(free, ·)``.
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
def store(A: np.ndarray, k: int, B: np.ndarray, rows: int) -> None:
    """Write the first ``rows`` of B into A[k], in a third of the time that an assignment of slices takes."""
    for i in range(rows):
        for j in range(B.shape[1]):
            A[k, i, j] = B[i, j]


@reordered
def add_product(A: np.ndarray, k: int, rows: int, columns: int, factor: float, v: np.ndarray, into: np.ndarray) -> None:
    """Add ``factor`` times the product of A[k]'s first rows and columns with a vector, to ``into``."""
    for i in range(rows):
        total = 0.0
        for j in range(columns):
            total += A[k, i, j] * v[j]
        into[i] += factor * total
