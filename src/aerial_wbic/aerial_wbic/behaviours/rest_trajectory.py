"""A smooth trajectory from one state of motion to rest, for any number of coordinates at once.

It is the response of three equal poles from (x_0, ẋ_0, ẍ_0 = 0) to rest at x_f: it brakes early and returns slowly. From
x_0 = x_f it goes 0.84 ẋ_0 / ω far, brakes with 0.80 ẋ_0 ω at most, and swings back with at most 0.08 ẋ_0 ω.
"""

from __future__ import annotations

import numpy as np

from aerial_model.numerics.jit import compiled

REACH = 0.84  # how far a trajectory that starts at its end goes, per ẋ_0 / ω
TIME = 8.0  # after which 99 % of an offset is gone, per 1 / ω
RATE, C_0, C_1, C_2, END = range(5)  # rows of a trajectory: ω, (c_0 + c_1 u + c_2 u²) exp(−u) with u = ω t, and x_f


def trajectory_to_rest(x_0: np.ndarray, xdot_0: np.ndarray, x_f: np.ndarray, rate: np.ndarray | float) -> np.ndarray:
    """Return the trajectory ``(5, m)`` from a state of motion to rest.

    Args:
        x_0: start ``(m,)``.
        xdot_0: rate at the start ``(m,)``.
        x_f: end ``(m,)``.
        rate: ω of the poles [1/s], positive, one or ``(m,)``.
    """
    offset, run = x_0 - x_f, xdot_0 / rate
    return np.array([np.broadcast_to(rate, offset.shape), offset, run + offset, run + offset / 2, x_f], dtype=float)


@compiled
def sampled_trajectory(trajectory: np.ndarray, time: float) -> np.ndarray:
    """Return x, ẋ and ẍ ``(3, m)`` at ``time`` [s] after the start of a trajectory ``(5, m)``."""
    now = np.empty((3, trajectory.shape[1]))
    for i in range(trajectory.shape[1]):
        rate, c_1, c_2 = trajectory[RATE, i], trajectory[C_1, i], trajectory[C_2, i]
        u = rate * time
        decay = np.exp(-u)
        x = trajectory[C_0, i] + (c_1 + c_2 * u) * u
        slope = c_1 + 2 * c_2 * u - x  # in u, before the decay
        curvature = 2 * c_2 - (c_1 + 2 * c_2 * u) - slope
        now[0, i] = trajectory[END, i] + x * decay
        now[1, i] = slope * decay * rate
        now[2, i] = curvature * decay * rate * rate
    return now
