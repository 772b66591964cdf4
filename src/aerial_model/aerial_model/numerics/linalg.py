"""Dense linear algebra for compiled code: triangular factors and solves that raise nothing."""

from __future__ import annotations

import numpy as np

from aerial_model.numerics.jit import compiled


@compiled
def cholesky(A: np.ndarray, L: np.ndarray) -> float:
    """Write the factor of a symmetric matrix ``(m, m)``, A = L Lᵀ, into L and return its least squared pivot.

    The factorization ends at the first pivot that is not positive; it is what is returned then.
    """
    least = np.inf
    for i in range(len(A)):
        for j in range(i + 1):
            rest = A[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            if i == j:
                least = min(least, rest)
                if not rest > 0.0:
                    return rest
                L[i, i] = np.sqrt(rest)
            else:
                L[i, j] = rest / L[j, j]
    return least


@compiled
def lower_solve(L: np.ndarray, B: np.ndarray) -> None:
    """Replace B ``(m, k)`` by the solution X of L X = B."""
    m, k = B.shape
    for i in range(m):
        inverse = 1.0 / L[i, i]
        for c in range(k):
            B[i, c] *= inverse
        for j in range(i + 1, m):
            factor = L[j, i]
            if factor != 0.0:
                for c in range(k):
                    B[j, c] -= factor * B[i, c]


@compiled
def upper_solve(L: np.ndarray, B: np.ndarray) -> None:
    """Replace B ``(m, k)`` by the solution X of Lᵀ X = B."""
    m, k = B.shape
    for i in range(m - 1, -1, -1):
        inverse = 1.0 / L[i, i]
        for c in range(k):
            B[i, c] *= inverse
        for j in range(i):
            factor = L[i, j]
            if factor != 0.0:
                for c in range(k):
                    B[j, c] -= factor * B[i, c]


@compiled
def cholesky_solve(L: np.ndarray, B: np.ndarray) -> None:
    """Replace B ``(m, k)`` by the solution X of L Lᵀ X = B."""
    lower_solve(L, B)
    upper_solve(L, B)


@compiled
def invert(A: np.ndarray, X: np.ndarray) -> None:
    """Write the inverse of a matrix ``(m, m)`` into X; of a singular one, or one that is not finite, what is not finite.

    It is what NumPy's would be, but for that one raising an exception, which a tick must not.
    """
    m = len(A)
    B = A.copy()
    X[:] = np.eye(m)
    for k in range(m):
        pivot = k + np.argmax(np.abs(B[k:, k]))
        for c in range(m):
            B[k, c], B[pivot, c] = B[pivot, c], B[k, c]
            X[k, c], X[pivot, c] = X[pivot, c], X[k, c]
        scale = 1.0 / B[k, k]
        for c in range(m):
            B[k, c] *= scale
            X[k, c] *= scale
        for r in range(m):
            if r != k:
                factor = B[r, k]
                for c in range(m):
                    B[r, c] -= factor * B[k, c]
                    X[r, c] -= factor * X[k, c]
