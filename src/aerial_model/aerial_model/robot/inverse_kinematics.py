"""Inverse kinematics by damped Gauss–Newton: joint positions, inside a range, at which points are where they should be."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

DAMPING = 1e-5  # [m²/rad²]

Residual = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
# Joint positions (n,) → what is missing to the wanted positions (m,) [m], and the Jacobian (m, n) of the positions.


def least_squares(
    residual: Residual,
    start: np.ndarray,
    limits: tuple[np.ndarray, np.ndarray],
    *,
    iterations: int,
    step_max: float,
) -> np.ndarray:
    """Return joint positions ``(n,)`` [rad] that bring the points as near as they get, in the least-squares sense.

    Args:
        residual: what is missing, and how it changes.
        start: joint positions to begin with ``(n,)`` [rad].
        limits: least and greatest joint positions ``(n,)`` [rad].
        iterations: how many steps are made.
        step_max: greatest change of a joint in one step [rad].
    """
    q_j = start
    for _ in range(iterations):
        error, J = residual(q_j)
        step = np.linalg.solve(J.T @ J + DAMPING * np.eye(len(q_j)), J.T @ error)
        q_j = np.clip(q_j + np.clip(step, -step_max, step_max), *limits)
    return q_j
