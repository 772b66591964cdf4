"""Where planning happens in the node: one request at a time, in a thread that yields the processor to others."""

from __future__ import annotations

import os
import threading
import traceback
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue

from rclpy.impl.rcutils_logger import RcutilsLogger

from aerial_model.errors import RefusalCode, RefusalError


class Worker:
    """Serves requests one by one and turns whatever goes wrong into a refusal.

    Args:
        niceness: of the thread, 0 to 19: a control loop on the same machine comes first.
        logger: for the tracebacks of faults.
    """

    def __init__(self, niceness: int, logger: RcutilsLogger) -> None:
        self.activity = "idle"  # what it is at, for a person
        self._logger = logger
        self._serving = threading.Lock()
        self._tasks: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, args=[niceness], name="planning", daemon=True)
        self._thread.start()

    def prepare(self, what: str, act: Callable[[], None]) -> None:
        """Do something before the next request is served."""
        self._tasks.put(partial(self._work, what, act, lambda fault: None))

    def serve(self, what: str, act: Callable[[], None], refuse: Callable[[RefusalError], None]) -> None:
        """Serve a request, or refuse it: at once if another is being served, later if serving it fails."""
        if not self._serving.acquire(blocking=False):
            refuse(RefusalError(RefusalCode.BUSY, "the planner is busy with another request"))
            return

        def work() -> None:
            try:
                self._work(what, act, refuse)
            finally:
                self._serving.release()

        self._tasks.put(work)

    def shutdown(self) -> None:
        """Finish what was asked for, then end."""
        self._tasks.put(None)
        self._thread.join()

    def _run(self, niceness: int) -> None:
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), niceness)  # on Linux: of this thread alone
        while (task := self._tasks.get()) is not None:
            try:
                task()
            except Exception:  # not even an answer could be given; the next request may fare better
                self._logger.error(traceback.format_exc())

    def _work(self, what: str, act: Callable[[], None], refuse: Callable[[RefusalError], None]) -> None:
        self.activity = what
        try:
            act()
        except RefusalError as refusal:
            refuse(refusal)
        except Exception as error:
            self._logger.error(traceback.format_exc())
            refuse(RefusalError(RefusalCode.INTERNAL, f"a fault of the planner: {type(error).__name__}: {error}"))
        finally:
            self.activity = "idle"
