"""What runs in every tick is compiled by Numba: in numpy the same formulas take four times as long.

The machine code is cached beside the sources (or where ``NUMBA_CACHE_DIR`` says): only the first start on a machine, or
after sources have changed, compiles, for about a minute. A tick must never do so: whoever owns compiled functions runs them
before they are used.
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any

import numpy as np
from numba import config, njit
from numba.core.dispatcher import Dispatcher

from aerial_model import actuator, rotation
from aerial_model.code_cache import LOCATORS


def _compiled(**options: Any) -> Callable[[FunctionType], Dispatcher]:
    decorate = njit(cache=True, error_model="numpy", **options)

    def decorated(function: FunctionType) -> Dispatcher:
        usual, config.CACHE_LOCATOR_CLASSES = config.CACHE_LOCATOR_CLASSES, LOCATORS
        try:
            return decorate(function)
        finally:
            config.CACHE_LOCATOR_CLASSES = usual

    return decorated


compiled = _compiled()
reordered = _compiled(fastmath={"contract", "nnan", "nsz", "reassoc"})  # sums in any order: several at once

product_of = compiled(rotation.product_of)
exp_of = compiled(rotation.exp_of)
log_of = compiled(rotation.log_of)
matrix_of = compiled(rotation.matrix_of)
friction_of = compiled(actuator.friction_of)
voltage_of = compiled(actuator.voltage_of)
torque_bounds_of = compiled(actuator.torque_bounds_of)


@compiled
def vector(a: np.ndarray) -> tuple:
    """Return the components of a vector ``(3,)``."""
    return a[0], a[1], a[2]


@compiled
def quaternion(a: np.ndarray) -> tuple:
    """Return the components of a quaternion ``(4,)``."""
    return a[0], a[1], a[2], a[3]


ZERO = (0.0, 0.0, 0.0)


@compiled
def sum_of(a: tuple, b: tuple, scale: float) -> tuple:
    """Return the components of a + scale · b."""
    return a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2]


@compiled
def cross_of(a: tuple, b: tuple) -> tuple:
    """Return the components of a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def inverse_of(q: tuple) -> tuple:
    """Return the components of the inverse of a unit quaternion."""
    return -q[0], -q[1], -q[2], q[3]


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
