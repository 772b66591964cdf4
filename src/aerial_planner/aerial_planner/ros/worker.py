"""Where planning happens in the node: one request at a time, in a thread that yields the processor to others."""

from __future__ import annotations

import os
import threading
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

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
        # On Linux the priority set is that of the calling thread alone.
        self._thread = ThreadPoolExecutor(
            1, "planning", lambda: os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), niceness)
        )

    def prepare(self, what: str, act: Callable[[], None]) -> None:
        """Do something before the next request is served."""
        self._thread.submit(self._work, what, act, lambda fault: None)

    def serve(self, what: str, act: Callable[[], None], refuse: Callable[[RefusalError], None]) -> None:
        """Serve a request, or refuse it: at once if another is being served, later if serving it fails."""
        if not self._serving.acquire(blocking=False):
            refuse(RefusalError(RefusalCode.BUSY, "the planner is busy with another request"))
            return
        self._thread.submit(self._work, what, act, refuse).add_done_callback(lambda _: self._serving.release())

    def shutdown(self) -> None:
        """Finish what is being served, drop what waits."""
        self._thread.shutdown(cancel_futures=True)

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
