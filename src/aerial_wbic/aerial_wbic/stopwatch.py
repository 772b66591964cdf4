"""How long the parts of a tick take, where somebody wants to know."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum

Clock = Callable[[], float]  # a time [s] whose differences are durations, such as ``time.thread_time``


class Part(StrEnum):
    """Parts of a tick; together they are all of it."""

    ESTIMATE = "estimate"
    KINEMATICS = "kinematics"
    TARGET = "target"
    HIERARCHY = "hierarchy"
    QP = "qp"
    TORQUE = "torque"


class Stopwatch:
    """Divides a tick's time among its parts.

    Args:
        clock: that tells the time; None: nothing is timed.
    """

    def __init__(self, clock: Clock | None = None) -> None:
        self._clock = clock
        self._since = 0.0  # when the part that runs began [s]
        self.durations: dict[Part, float] = {}  # of the last tick's parts [s]

    def start(self) -> None:
        """Begin a tick."""
        if self._clock is not None:
            self.durations = dict.fromkeys(Part, 0.0)
            self._since = self._clock()

    def lap(self, part: Part) -> None:
        """Count the time since the last lap as that of ``part``."""
        if self._clock is not None:
            now = self._clock()
            self.durations[part] += now - self._since
            self._since = now
