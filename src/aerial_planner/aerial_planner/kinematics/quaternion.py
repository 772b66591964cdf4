"""Attitudes as CasADi expressions: unit quaternions x, y, z, w, their products, steps and errors."""

from __future__ import annotations

from typing import TypeVar

import casadi as ca

Expression = TypeVar("Expression", ca.SX, ca.MX, ca.DM)


def rotation_matrix(quaternion: Expression) -> Expression:
    """Return R ``(3, 3)`` of a unit quaternion xyzw."""
    x, y, z, w = ca.vertsplit(quaternion)
    return ca.vertcat(
        ca.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        ca.horzcat(2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        ca.horzcat(2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def quaternion_product(a: Expression, b: Expression) -> Expression:
    """Return a ⊗ b of quaternions xyzw."""
    av, aw, bv, bw = a[:3], a[3], b[:3], b[3]
    return ca.vertcat(aw * bv + bw * av + ca.cross(av, bv), aw * bw - ca.dot(av, bv))


def conjugate(q: Expression) -> Expression:
    """Return the inverse of a unit quaternion xyzw."""
    return ca.vertcat(-q[:3], q[3])


def quaternion_step(omega: Expression, dt: Expression) -> Expression:
    """Return the quaternion of a turn by ω dt.

    The series of cos and sin(x)/x in x² = |ω dt / 2|² has no singularity at rest; up to 1 rad it is exact to 1e-10.
    """
    half = 0.5 * dt * omega
    s = ca.dot(half, half)
    cosine = 1 - s / 2 * (1 - s / 12 * (1 - s / 30 * (1 - s / 56 * (1 - s / 90))))
    sinc = 1 - s / 6 * (1 - s / 20 * (1 - s / 42 * (1 - s / 72 * (1 - s / 110))))
    return ca.vertcat(sinc * half, cosine)


def attitude_error(quaternion: Expression, reference: Expression) -> Expression:
    """Return twice the vector part of q_ref* ⊗ q: the rotation vector of small errors ``(3,)`` [rad]."""
    return 2 * quaternion_product(conjugate(reference), quaternion)[:3]
