"""What the ground can give to a robot on all of its contact points: which acceleration, by which forces."""

from __future__ import annotations

import numpy as np

from aerial_model.kinematics import Configuration
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.linalg import cholesky, cholesky_solve
from aerial_model.robot.robot import GRAVITY

_SUPPORT_SHARE = 0.8  # of the support's extent that the resultant force may use
_VERTICAL = 1e-6  # horizontal part of the base's x axis below which it has no heading
_WRENCH_REGULARIZATION = 1e-6  # [m²] keeps the share of the load defined when the support is a line or a point


@compiled
def support_centre(state: Configuration) -> np.ndarray:
    """Return the mean of the contact spheres' centres ``(3,)`` [m] in W."""
    n_c, centre = len(state.contact_positions), np.zeros(3)
    for i in range(n_c):
        for k in range(3):
            centre[k] += state.contact_positions[i, k] / n_c
    return centre


@compiled
def supported(state: Configuration, acceleration: np.ndarray) -> np.ndarray:
    """Return the acceleration of the centre of mass nearest to one ``(3,)`` that the support gives without turning the body.

    The line of the force through the centre of mass meets the ground within a part of the rectangle, along the heading,
    that the contact points span; the rest is for moments. What is asked for beyond that would roll the feet over.
    """
    points, com, R = state.contact_positions, state.com, state.R_WB
    F = acceleration[2] + GRAVITY
    height = com[2] - support_centre(state)[2]
    result = acceleration.copy()
    if F <= 0 or height <= 0:
        return result
    level = max(np.hypot(R[0, 0], R[1, 0]), _VERTICAL)
    ahead = R[0, 0] / level, R[1, 0] / level
    for x, y in (ahead, (-ahead[1], ahead[0])):
        least, most = np.inf, -np.inf
        for i in range(len(points)):
            reach = (points[i, 0] - com[0]) * x + (points[i, 1] - com[1]) * y
            least, most = min(least, reach), max(most, reach)
        middle, half = (most + least) / 2, _SUPPORT_SHARE * (most - least) / 2
        wanted = acceleration[0] * x + acceleration[1] * y
        meets = -wanted * height / F  # from under the centre of mass, against the acceleration
        allowed = min(max(meets, middle - half), middle + half)
        change = -allowed * F / height - wanted
        result[0] += change * x
        result[1] += change * y
    return result


@compiled
def shared_load(state: Configuration, com_acceleration: np.ndarray, force: np.ndarray) -> None:
    """Write forces ``(n_c, 3)`` [N] in W that accelerate the centre of mass and do not turn the body.

    Every point takes a share w_i of the same force F = m (r̈ − g): Σ w_i = 1, and Σ w_i c_i lies where F through the
    centre of mass meets the height of the support. Of these shares it is the most even one; none is negative.
    """
    points, com, n_c = state.contact_positions, state.com, len(state.contact_positions)
    F_x, F_y = state.mass * com_acceleration[0], state.mass * com_acceleration[1]
    F_z = state.mass * (com_acceleration[2] + GRAVITY)
    # w = Aᵀ (A Aᵀ + ε)⁻¹ b with a column (1, x_i, y_i) in A for every point, seen from the centre of mass.
    A, b, L, column = np.zeros((3, 3)), np.zeros((3, 1)), np.empty((3, 3)), np.ones(3)
    rise = 0.0
    for i in range(n_c):
        column[1], column[2] = points[i, 0] - com[0], points[i, 1] - com[1]
        rise += (points[i, 2] - com[2]) / n_c
        for j in range(3):
            for k in range(3):
                A[j, k] += column[j] * column[k]
    for k in range(3):
        A[k, k] += _WRENCH_REGULARIZATION
    b[0, 0] = 1.0
    if F_z > 0:
        b[1, 0], b[2, 0] = rise * F_x / F_z, rise * F_y / F_z
    cholesky(A, L)
    cholesky_solve(L, b)
    for i in range(n_c):
        share = b[0, 0] + b[1, 0] * (points[i, 0] - com[0]) + b[2, 0] * (points[i, 1] - com[1])
        share = max(share, 0.0)
        force[i, 0], force[i, 1], force[i, 2] = share * F_x, share * F_y, share * F_z
