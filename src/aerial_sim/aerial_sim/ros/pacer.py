"""The clock of a simulation in real time: something happens at absolute deadlines, a period apart."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

LATE = 0.25  # of a period, by which a tick may begin behind its time and the next still keep to theirs


class Pacer:
    """A thread that acts once a period.

    An action that came out late shifts what follows: who answers has a whole period, counted from the action, whatever
    the machine does to this thread.

    Args:
        period: from one action to the next, wall time [s].
        act: what is to be done.
    """

    def __init__(self, period: float, act: Callable[[], None]) -> None:
        self.late_ticks = 0
        self._period = period
        self._act = act
        self._running = True
        self._thread = threading.Thread(target=self._run, name="pace", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Act no more; return when the last action is over."""
        self._running = False
        self._thread.join()

    def _run(self) -> None:
        deadline = time.monotonic()
        while self._running:
            deadline += self._period
            spare = deadline - time.monotonic()
            if spare > 0:
                time.sleep(spare)
            now = time.monotonic()
            if now - deadline > LATE * self._period:
                self.late_ticks += 1
                deadline = now
            self._act()
