"""Percentiles of many durations in little memory."""

from __future__ import annotations

import numpy as np

RESOLUTION = 5e-6  # [s]
LONGEST = 0.1  # longer ones count as this [s]


class Latency:
    """A histogram of durations."""

    def __init__(self) -> None:
        self._counts = np.zeros(round(LONGEST / RESOLUTION) + 1, dtype=np.int64)

    def add(self, duration: float) -> None:
        """Count one duration [s]."""
        self._counts[min(round(duration / RESOLUTION), len(self._counts) - 1)] += 1

    def percentile(self, percent: float) -> float:
        """Return the duration [s] that ``percent`` of all do not exceed; 0 if there is none."""
        reached = np.cumsum(self._counts) >= percent / 100 * self._counts.sum()
        return float(np.argmax(reached)) * RESOLUTION
