"""A smooth way from one state of motion to rest."""

from __future__ import annotations

import numpy as np


class Settling:
    """The response of three equal poles from (x_0, ẋ_0, ẍ_0 = 0) to rest at x_f: it brakes early and returns slowly.

    From x_0 = x_f it goes 0.84 ẋ_0 / ω far, brakes with 0.80 ẋ_0 ω at most, and swings back with at most 0.08 ẋ_0 ω.

    Args:
        x_0: start ``(m,)``.
        xdot_0: rate at the start ``(m,)``.
        x_f: end ``(m,)``.
        rate: ω of the poles [1/s], positive, one or ``(m,)``.
    """

    REACH = 0.84  # how far it goes, per ẋ_0 / ω
    TIME = 8.0  # after which 99 % of an offset is gone, per 1 / ω

    def __init__(self, x_0: np.ndarray, xdot_0: np.ndarray, x_f: np.ndarray, rate: np.ndarray | float) -> None:
        offset, run = x_0 - x_f, xdot_0 / rate
        self._x_f = x_f
        self._rate = rate
        self._c = (offset, run + offset, run + offset / 2)  # (c_0 + c_1 u + c_2 u²) exp(−u) with u = ω t

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return x, ẋ and ẍ ``(m,)`` at ``time`` [s] after the start."""
        u = self._rate * time
        decay = np.exp(-u)
        c_0, c_1, c_2 = self._c
        x = c_0 + (c_1 + c_2 * u) * u
        slope = c_1 + 2 * c_2 * u - x  # in u, before the decay
        curvature = 2 * c_2 - (c_1 + 2 * c_2 * u) - slope
        return self._x_f + x * decay, slope * decay * self._rate, curvature * decay * self._rate**2
