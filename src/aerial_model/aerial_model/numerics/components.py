"""Vectors, quaternions and rotations as tuples of components, for compiled code: no array is made."""

from __future__ import annotations

import numpy as np

from aerial_model.numerics import rotation
from aerial_model.numerics.jit import compiled

product_of = compiled(rotation.product_of)
exp_of = compiled(rotation.exp_of)
log_of = compiled(rotation.log_of)
matrix_of = compiled(rotation.matrix_of)


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
