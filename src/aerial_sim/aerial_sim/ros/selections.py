"""What the simulator hears of selections and their answers: what lock-step waits for, and whether a motion runs."""

from __future__ import annotations

import time

from aerial_model.values.request import ControllerCommand
from aerial_msgs.msg import MotionResult, MotionSelection
from aerial_sim.exchange import Exchange

PLAN_TIMEOUT = 10.0  # wall time for which lock-step waits for the answer to a selection … [s]
START_TIMEOUT = 8.0  # … and, once it is planned, for the controller's [s]
MOTION_TIME_MAX = 20.0  # simulated time after which a motion is over even if nobody has said so [s]
FINAL = (MotionResult.REFUSED, MotionResult.LANDED, MotionResult.FAILED, MotionResult.ABORTED)


class Selections:
    """Follows selections from their arrival to their last answer; it never changes the world.

    Args:
        exchange: whose time may have to wait for a plan.
        lock_step: whether it has to.
    """

    def __init__(self, exchange: Exchange, *, lock_step: bool) -> None:
        self._exchange = exchange
        self._lock_step = lock_step
        self._running: str | None = None  # request whose motion has begun
        self._began = 0.0  # simulated time of that [s]
        self._refused: str | None = None  # request last refused: time need not wait for it
        self._wait_until = 0.0  # when lock-step stops waiting, monotonic [s]

    @property
    def motion_runs(self) -> bool:
        """Whether a motion has begun and is not over."""
        time_running = self._exchange.simulation.time - self._began
        return self._running is not None and 0.0 <= time_running < MOTION_TIME_MAX

    def reset(self) -> None:
        """Begin anew with the robot."""
        self._running = None

    def on_selection(self, message: MotionSelection) -> None:
        """In lock-step, let time wait for the plan."""
        alone = message.motion in list(ControllerCommand)  # the controller needs no plan for these
        if self._lock_step and not alone and not self.motion_runs and message.request_id != self._refused:
            self._exchange.awaited = message.request_id
            self._wait_until = time.monotonic() + PLAN_TIMEOUT

    def on_result(self, message: MotionResult) -> None:
        """Take note of an answer; it may be what time waits for."""
        if message.outcome == MotionResult.STARTED:
            self._running, self._began = message.request_id, self._exchange.simulation.time
        elif message.outcome in FINAL and message.request_id == self._running:
            self._running = None
        elif message.outcome == MotionResult.REFUSED:
            self._refused = message.request_id  # the answer may outrun the selection
        if message.request_id != self._exchange.awaited:
            return
        if message.outcome == MotionResult.PLANNED:
            self._wait_until = time.monotonic() + START_TIMEOUT  # for the controller to have the plan as well
        else:
            self._exchange.awaited = None

    def overdue(self) -> str | None:
        """Return the request that has been waited for too long, and wait no longer; None if there is none."""
        awaited = self._exchange.awaited
        if awaited is None or time.monotonic() <= self._wait_until:
            return None
        self._exchange.awaited = None
        return awaited
