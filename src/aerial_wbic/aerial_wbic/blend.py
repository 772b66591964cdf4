"""A smooth way from one state of motion to rest."""

from __future__ import annotations

import numpy as np


class Blend:
    """The quintic from (x_0, ẋ_0, ẍ_0 = 0) to rest at x_f in a given time, held there afterwards.

    Args:
        x_0: start ``(m,)``.
        xdot_0: rate at the start ``(m,)``.
        x_f: end ``(m,)``.
        duration: [s], positive.
    """

    def __init__(self, x_0: np.ndarray, xdot_0: np.ndarray, x_f: np.ndarray, duration: float) -> None:
        distance, run = x_f - x_0, xdot_0 * duration  # in s = t / duration the rate is ``run``
        self._duration = duration
        self._coefficients = np.array(  # of s⁰ … s⁵, (6, m)
            [
                x_0,
                run,
                np.zeros_like(x_0),
                10 * distance - 6 * run,
                -15 * distance + 8 * run,
                6 * distance - 3 * run,
            ]
        )

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return x, ẋ and ẍ ``(m,)`` at ``time`` [s] after the start."""
        s = min(max(time / self._duration, 0.0), 1.0)
        powers = np.array(
            [
                [1.0, s, s**2, s**3, s**4, s**5],
                [0.0, 1.0, 2 * s, 3 * s**2, 4 * s**3, 5 * s**4],
                [0.0, 0.0, 2.0, 6 * s, 12 * s**2, 20 * s**3],
            ]
        )
        x, slope, curvature = powers @ self._coefficients
        return x, slope / self._duration, curvature / self._duration**2
