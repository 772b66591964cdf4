"""The last plan that no controller has answered yet, shared by the planning thread and the node's own."""

from __future__ import annotations

import threading

from aerial_msgs.msg import MotionPlan, MotionResult


class UnansweredPlan:
    """Keeps the last plan until a controller says what becomes of it, or its time is over; safe among threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._plan: MotionPlan | None = None
        self._until = 0.0  # monotonic [s]

    def put(self, plan: MotionPlan, until: float) -> None:
        """Keep a plan, instead of the one before, ``until`` a time of the monotonic clock [s]."""
        with self._lock:
            self._plan, self._until = plan, until

    def answered(self, result: MotionResult) -> None:
        """Forget the plan if this is a controller's answer to it."""
        with self._lock:
            plan = self._plan
            if plan is not None and result.request_id == plan.request_id and result.outcome != MotionResult.PLANNED:
                self._plan = None

    def at(self, now: float) -> MotionPlan | None:
        """Return the plan if there is one that has not been answered ``now`` (monotonic) [s]."""
        with self._lock:
            return self._plan if now < self._until else None
