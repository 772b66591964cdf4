"""How a node of Aerial lives: a lifecycle it walks through by itself, diagnostics once a second, a clean end.

A node says what it is in three methods: ``configure``, ``cleanup`` and ``diagnose``; ``main`` runs it as a process.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.signals import SignalHandlerOptions

from aerial_model.errors import AerialError

_SPIN_TIMEOUT = 0.5  # [s] after which the loop looks whether it shall end
_DIAGNOSTICS_PERIOD = 1.0  # [s]


class AerialNode(LifecycleNode):
    """A lifecycle node that shares its parameters with all others.

    Parameters: ``robot`` (name or folder), ``autostart`` (false: wait for a lifecycle manager), ``realtime_priority``
    (1 to 99: schedule all threads of the process before ordinary ones, where the system permits it), ``processor``
    (number of the one that all threads of the process shall share).
    """

    def __init__(self, name: str, **kwargs: object) -> None:
        super().__init__(name, **kwargs)
        self.declare_parameter("robot", "mini_cheetah")
        self.declare_parameter("autostart", True)
        self.declare_parameter("realtime_priority", 0)
        self.declare_parameter("processor", -1)
        self._acting = False

    def configure(self) -> None:
        """Build what the node works with, what may fail before any interface.

        Raises:
            AerialError: to stay unconfigured; its sentence goes to the log.
        """

    def activate(self) -> None:
        """Begin to act."""

    def deactivate(self) -> None:
        """Cease to act."""

    def cleanup(self) -> None:
        """Give back what ``configure`` built, interfaces included."""

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Return level (of ``DiagnosticStatus``), one sentence, and figures, for ``/diagnostics``."""
        return DiagnosticStatus.OK, "", {}

    def start(self) -> bool:
        """Configure and activate unless parameter ``autostart`` is false; return whether that worked."""
        if not self.get_parameter("autostart").value:
            return True
        success = TransitionCallbackReturn.SUCCESS
        return self.trigger_configure() == success and self.trigger_activate() == success

    def stop(self) -> None:
        """Cease to act, if the node does."""
        if self._acting:
            self.trigger_deactivate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Build everything, or say in one sentence why that cannot be."""
        if not self._succeeds(self.configure):
            return TransitionCallbackReturn.FAILURE
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 1)
        self._diagnostics_timer = self.create_timer(_DIAGNOSTICS_PERIOD, self._publish_diagnostics)
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Enable the publishers, then act."""
        result = super().on_activate(state)
        self._acting = self._succeeds(self.activate)
        return result if self._acting else TransitionCallbackReturn.FAILURE

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Cease to act, then disable the publishers."""
        self.deactivate()
        self._acting = False
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give everything back."""
        self.destroy_timer(self._diagnostics_timer)
        self.destroy_publisher(self._diagnostics)
        self.cleanup()
        return super().on_cleanup(state)

    def _succeeds(self, act: Callable[[], None]) -> bool:
        try:
            act()
        except AerialError as error:
            self.get_logger().fatal(str(error))
            return False
        except Exception:  # rclpy would swallow it without a word
            self.get_logger().fatal(traceback.format_exc())
            raise
        return True

    def _publish_diagnostics(self) -> None:
        level, message, figures = self.diagnose()
        values = [KeyValue(key=key, value=str(value)) for key, value in figures.items()]
        status = DiagnosticStatus(
            level=level, name=self.get_fully_qualified_name(), message=message, hardware_id="", values=values
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)


def main(make_node: Callable[[], AerialNode]) -> None:
    """Run a node as a process until SIGINT or SIGTERM; the exit status is 1 if it could not start.

    A signal only asks the loop to end: rclpy's own handlers would invalidate the context under running callbacks. Once
    the node is destroyed and rclpy shut down the process ends at once: in the interpreter's own end, destructors of
    libraries race with threads of libraries, which can end a process with a segmentation fault.
    """
    asked_to_end = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: asked_to_end.set())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = make_node()
    executor = EventsExecutor()
    executor.add_node(node)
    started = node.start()
    _claim_processor(node)
    gc.collect()
    gc.freeze()  # what is there now stays: later collections need not look at it
    while started and not asked_to_end.is_set():  # EventsExecutor.spin() would busy-wait without serving anything
        executor.spin_once(timeout_sec=_SPIN_TIMEOUT)
    node.stop()
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0 if started else 1)


def _claim_processor(node: AerialNode) -> None:
    """Place and schedule every thread there is as the parameters say, those of DDS included: they carry the messages."""
    priority, processor = node.get_parameter("realtime_priority").value, node.get_parameter("processor").value
    threads = [int(name) for name in os.listdir("/proc/self/task")]
    try:
        for thread in threads if processor >= 0 else ():
            os.sched_setaffinity(thread, {processor})
        for thread in threads if priority > 0 else ():
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        node.get_logger().info(
            f"no processor {processor} or no real-time priority {priority} ({error.strerror}): on a busy machine the "
            "control loop will miss ticks; an rtprio limit of the user (limits.conf) permits the priority"
        )
