"""Rotations: unit quaternions in Pinocchio's order (x, y, z, w) and rotation vectors; singularity-free everywhere.

``R_AB`` maps coordinates in B to coordinates in A; ``exp`` and ``log`` are the maps of SO(3).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
IDENTITY.flags.writeable = False
_TINY = float(np.finfo(float).tiny)  # keeps 0 / 0 from happening where the numerator is 0 too


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the Hamilton product a ⊗ b of quaternions ``(..., 4)``, so that R(a ⊗ b) = R(a) R(b)."""
    return _along_last_axis(product_of(_components(a), _components(b)))


def conjugate(q: np.ndarray) -> np.ndarray:
    """Return the inverse of unit quaternions ``(..., 4)``."""
    x, y, z, w = _components(q)
    return _along_last_axis([-x, -y, -z, w])


def exp(rotation_vector: np.ndarray) -> np.ndarray:
    """Return the quaternion ``(..., 4)`` of a rotation vector ``(..., 3)`` [rad]."""
    return _along_last_axis(exp_of(_components(rotation_vector)))


def log(q: np.ndarray) -> np.ndarray:
    """Return the rotation vector ``(..., 3)`` [rad], of length at most π, of unit quaternions ``(..., 4)``."""
    return _along_last_axis(log_of(_components(q)))


def matrix(q: np.ndarray) -> np.ndarray:
    """Return the rotation matrices ``(..., 3, 3)`` of unit quaternions ``(..., 4)``."""
    R = np.array(matrix_of(_components(q)))
    return R if R.ndim == 2 else np.moveaxis(R, (0, 1), (-2, -1))


def about_z(yaw: float) -> np.ndarray:
    """Return the quaternion ``(4,)`` of a turn by ``yaw`` [rad] about z."""
    return exp(np.array([0.0, 0.0, yaw]))


def heading(q: np.ndarray) -> float:
    """Return the heading [rad] of a body with attitude ``q`` ``(4,)``: the angle of its x axis seen from above."""
    x, y, z, w = np.asarray(q, dtype=float)
    return float(np.arctan2(2 * (x * y + z * w), 1 - 2 * (y * y + z * z)))


def tilt(q: np.ndarray) -> float:
    """Return the angle [rad] between the body's z axis and the vertical."""
    return float(np.arccos(np.clip(matrix(q)[2, 2], -1.0, 1.0)))


# The formulas, on tuples of components: numbers, or arrays of one shape. They compile as they stand.


def product_of(a: tuple, b: tuple) -> tuple:
    """Return the components (x, y, z, w) of a ⊗ b."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def exp_of(rotation_vector: tuple) -> tuple:
    """Return the components (x, y, z, w) of the quaternion of a rotation vector (x, y, z) [rad]."""
    x, y, z = rotation_vector
    angle = np.sqrt(x * x + y * y + z * z)
    scale = np.sin(angle / 2) / np.maximum(angle, _TINY)
    return scale * x, scale * y, scale * z, np.cos(angle / 2)


def log_of(q: tuple) -> tuple:
    """Return the components (x, y, z) [rad] of the rotation vector of a unit quaternion (x, y, z, w)."""
    x, y, z, w = q
    sine = np.sqrt(x * x + y * y + z * z)
    scale = np.copysign(2 * np.arctan2(sine, np.abs(w)) / np.maximum(sine, _TINY), w)
    return scale * x, scale * y, scale * z


def matrix_of(q: tuple) -> tuple:
    """Return the rows of the rotation matrix of a unit quaternion (x, y, z, w)."""
    x, y, z, w = q
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def _components(a: np.ndarray) -> tuple:
    """Return the slices of an array along its last axis; of a single vector as floats, whose arithmetic is fastest."""
    a = np.asarray(a, dtype=float)
    return tuple(a.tolist() if a.ndim == 1 else np.moveaxis(a, -1, 0))


def _along_last_axis(components: Sequence) -> np.ndarray:
    """Return components as one array, along its last axis."""
    a = np.array(components)
    return a if a.ndim == 1 else np.moveaxis(a, 0, -1)
