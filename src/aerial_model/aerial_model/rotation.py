"""Rotations: unit quaternions in Pinocchio's order (x, y, z, w) and rotation vectors; singularity-free everywhere.

``R_AB`` maps coordinates in B to coordinates in A; ``exp`` and ``log`` are the maps of SO(3).
"""

from __future__ import annotations

import numpy as np

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
IDENTITY.flags.writeable = False
_SMALL = 1e-8  # [rad] below this the series of sin(x)/x is exact to rounding


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the Hamilton product a ⊗ b of quaternions ``(..., 4)``, so that R(a ⊗ b) = R(a) R(b)."""
    ax, ay, az, aw = np.moveaxis(np.asarray(a), -1, 0)
    bx, by, bz, bw = np.moveaxis(np.asarray(b), -1, 0)
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        axis=-1,
    )


def conjugate(q: np.ndarray) -> np.ndarray:
    """Return the inverse of unit quaternions ``(..., 4)``."""
    return np.asarray(q) * np.array([-1.0, -1.0, -1.0, 1.0])


def exp(rotation_vector: np.ndarray) -> np.ndarray:
    """Return the quaternion ``(..., 4)`` of a rotation vector ``(..., 3)`` [rad]."""
    phi = np.asarray(rotation_vector, dtype=float)
    angle = np.linalg.norm(phi, axis=-1, keepdims=True)
    scale = np.where(angle > _SMALL, np.sin(angle / 2) / np.where(angle > _SMALL, angle, 1.0), 0.5 - angle**2 / 48)
    return np.concatenate([scale * phi, np.cos(angle / 2)], axis=-1)


def log(q: np.ndarray) -> np.ndarray:
    """Return the rotation vector ``(..., 3)`` [rad], of length at most π, of unit quaternions ``(..., 4)``."""
    q = np.asarray(q, dtype=float)
    q = np.where(q[..., 3:] < 0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., 3:])
    return np.where(sine > _SMALL, angle / np.where(sine > _SMALL, sine, 1.0), 2.0) * q[..., :3]


def matrix(q: np.ndarray) -> np.ndarray:
    """Return the rotation matrices ``(..., 3, 3)`` of unit quaternions ``(..., 4)``."""
    x, y, z, w = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=-1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=-1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=-1),
        ],
        axis=-2,
    )


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


def slerp(a: np.ndarray, b: np.ndarray, fraction: float) -> np.ndarray:
    """Return the attitude ``(4,)`` at ``fraction`` of the shortest turn from ``a`` to ``b``."""
    return multiply(a, exp(fraction * log(multiply(conjugate(a), b))))


def skew(p: np.ndarray) -> np.ndarray:
    """Return the matrix ``(3, 3)`` with ``skew(p) @ x = p × x``."""
    x, y, z = p
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
