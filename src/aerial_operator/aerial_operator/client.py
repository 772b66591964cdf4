"""The operator's end of ROS: selects motions and hears what comes of them."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.values.request import ControllerCommand, MotionRequest
from aerial_msgs.msg import ControllerStatus, MotionResult, MotionSelection
from aerial_msgs.srv import Reset, SetTerrain
from aerial_operator.processes import CONTROLLER, PLANNER, PROGRAMS, SIMULATOR, NodeProgram
from aerial_operator.terrain import TerrainService
from aerial_ros import qos
from aerial_ros.messages import code_from_message, from_stamp, outcome_from_message, selection_to_message

WARMING_UP = "warming up"  # how the planner's diagnostics begin then
DISCOVERY_TIMEOUT = 8.0  # for a listener to be found, on a machine whose cores are busy [s]
ACQUAINTANCE_TIMEOUT = 2.0  # for a first word of those who will answer: they know then that we listen [s]
PLANNING_TIMEOUT = 15.0  # for a first answer; a planner that has just started builds its problems first [s]
START_TIMEOUT = 15.0  # from plan to motion; nodes just started find each other first, however busy the cores [s]
MOTION_TIMEOUT = 20.0  # from start to end [s]
DIAGNOSTICS_TIMEOUT = 5.0  # [s]
_CHECK_PERIOD = 0.25  # [s]
_SPIN_TIMEOUT = 0.1  # within which Ctrl-C is served [s]


@dataclass(frozen=True, kw_only=True)
class Answer:
    """One answer to a selection."""

    outcome: str  # a constant of ``MotionResult`` in lower case
    code: RefusalCode | None
    reason: str
    after: float  # since the selection, wall time [s]

    @property
    def final(self) -> bool:
        """Whether no further answer follows."""
        return self.outcome in ("refused", "landed", "failed", "aborted")

    def __str__(self) -> str:
        return f"{self.outcome} after {self.after:.2f} s" + (f": {self.reason}" if self.reason else "")

    def to_json(self) -> dict[str, Any]:
        """Return the answer as plain JSON types."""
        return {"outcome": self.outcome, "code": self.code, "reason": self.reason, "after_s": self.after}


class Client(Node):
    """A node that selects motions; made by ``connected``."""

    def __init__(self, context: rclpy.Context, executor: EventsExecutor, check: Callable[[], None]) -> None:
        super().__init__("operator", context=context, use_global_arguments=False)
        self._executor = executor
        self._check = check
        self._next_check = 0.0
        self._selections = self.create_publisher(MotionSelection, "motion_selection", qos.EVENT)
        self.create_subscription(MotionResult, "motion_result", self._on_result, qos.ANSWER)
        self.create_subscription(ControllerStatus, "controller_status", self._on_status, qos.TELEMETRY)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, qos.EVENT)
        self.status: ControllerStatus | None = None  # the controller's last
        self.diagnostics: dict[str, tuple[str, dict[str, str]]] = {}  # node → last message and figures
        self._results: list[tuple[float, MotionResult]] = []

    @property
    def time(self) -> float:
        """Time of the last state the controller served [s]; 0 before the first."""
        return 0.0 if self.status is None else from_stamp(self.status.stamp)

    def figures(self, program: NodeProgram) -> dict[str, str]:
        """Return the figures of a node's next diagnostics.

        Raises:
            RefusalError: with code TIMEOUT if none come.
        """
        self.diagnostics.pop(program.name, None)
        if not self.wait(lambda: program.name in self.diagnostics, DIAGNOSTICS_TIMEOUT):
            raise _timeout(f"no diagnostics from {program.name} for {DIAGNOSTICS_TIMEOUT:.0f} s")
        return self.diagnostics[program.name][1]

    @property
    def missing(self) -> list[str]:
        """What keeps a motion from being selected, each in a few words; empty when all is ready."""
        missing = [f"no word from {program.name}" for program in PROGRAMS if program.name not in self.diagnostics]
        if self.status is None or self.status.phase != ControllerStatus.STAND:
            missing.append("the robot does not stand")
        return missing

    @property
    def warm(self) -> bool:
        """Whether the planner has built the problems it was told to build: until then a plan may take longer."""
        activity, _ = self.diagnostics.get(PLANNER.name, (WARMING_UP, {}))
        return not activity.startswith(WARMING_UP)

    def wait(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Serve messages until ``condition`` holds, ``timeout`` [s] at most; return whether it does."""
        deadline = time.monotonic() + timeout
        while not condition():
            now = time.monotonic()
            if now >= deadline:
                return False
            if now >= self._next_check:
                self._next_check = now + _CHECK_PERIOD
                self._check()
            self._executor.spin_once(timeout_sec=min(_SPIN_TIMEOUT, deadline - now))
        return True

    def select(
        self, request: MotionRequest, heard: Callable[[Answer], None] = lambda answer: None
    ) -> tuple[str, list[Answer]]:
        """Ask for a motion and wait until it is over.

        If the robot is simulated, the terrain of the request is placed in its world first, and what was there before is put
        back if nothing came of the request. A request without terrain leaves the world as it is.

        Args:
            request: its request id is chosen here.
            heard: called with each answer when it comes.

        Returns:
            the request id, and the answers, of which the last is final.

        Raises:
            RefusalError: with code TIMEOUT if an answer is missing, saying who is silent.
        """
        request = replace(request, request_id=uuid.uuid4().hex[:8])
        server = CONTROLLER if request.motion in list(ControllerCommand) else PLANNER
        if not self.wait(lambda: self._listens(server.name), DISCOVERY_TIMEOUT):
            raise _timeout(f"no {server.name} is running: nobody would answer; start one with ./aerial up")
        self.wait(lambda: self._heard(server) and self._heard(CONTROLLER), ACQUAINTANCE_TIMEOUT)
        self._results.clear()
        answers: list[Answer] = []
        terrain = TerrainService(self, self.wait)
        before: SetTerrain.Request | None = None
        if request.terrain.boxes and terrain.simulated:
            try:
                before = terrain.place(request.terrain)
            except RefusalError as refusal:
                answers.append(Answer(outcome="refused", code=refusal.code, reason=refusal.reason, after=0.0))
                heard(answers[-1])
                return request.request_id, answers
        try:
            self._ask(request, server.name, answers, heard)
        finally:
            if before is not None and not _began(answers):
                with suppress(RefusalError):  # it began after all, unheard: its terrain stays
                    terrain.call(before)
        return request.request_id, answers

    def _ask(self, request: MotionRequest, server: str, answers: list[Answer], heard: Callable[[Answer], None]) -> None:
        """Publish a selection and add its answers to ``answers`` as they come, until the final one."""
        selected = time.monotonic()
        self._selections.publish(selection_to_message(request))
        while not answers or not answers[-1].final:
            answers.append(self._next_answer(request, answers, selected, server))
            heard(answers[-1])

    def reset_robot(self, seed: int) -> None:
        """Put the simulated robot back to its start; return when it stands there, its counters at zero.

        Raises:
            RefusalError: with code TIMEOUT if it does not come to stand.
        """
        service = self.create_client(Reset, f"{SIMULATOR.name}/reset")
        before = self.time
        answered = self.wait(service.service_is_ready, DISCOVERY_TIMEOUT)
        if answered:
            future = service.call_async(Reset.Request(seed=seed))
            answered = self.wait(future.done, START_TIMEOUT)
        self.destroy_client(service)
        if not answered or not self.wait(lambda: self.time < before and not self.missing, START_TIMEOUT):
            raise _timeout(f"the robot did not stand again within {START_TIMEOUT:.0f} s after its reset")

    def _next_answer(self, request: MotionRequest, answers: list[Answer], selected: float, server: str) -> Answer:
        if not answers:
            timeout, silent = PLANNING_TIMEOUT, f"the {server} did not answer"
        elif _began(answers):
            timeout, silent = MOTION_TIMEOUT, "the motion began, but its end was not reported"
        else:
            timeout, silent = START_TIMEOUT, f"a plan was made, but no {CONTROLLER.name} began it"
        if not self.wait(lambda: self._answers(request.request_id) > len(answers), timeout):
            raise _timeout(f"{silent} within {timeout:.0f} s")
        arrived, result = [(t, r) for t, r in self._results if r.request_id == request.request_id][len(answers)]
        return Answer(
            outcome=outcome_from_message(result),
            code=code_from_message(result),
            reason=result.reason,
            after=arrived - selected,
        )

    def _answers(self, request_id: str) -> int:
        return sum(result.request_id == request_id for _, result in self._results)

    def _listens(self, name: str) -> bool:
        return any(end.node_name == name for end in self.get_subscriptions_info_by_topic("motion_selection"))

    def _heard(self, program: NodeProgram) -> bool:
        """Return whether a node has said anything: it learnt of our other subscriptions, made first, before that."""
        return program.name in self.diagnostics or (program is CONTROLLER and self.status is not None)

    def _on_result(self, message: MotionResult) -> None:
        known = {(result.request_id, result.outcome) for _, result in self._results}
        if (message.request_id, message.outcome) not in known:  # a repeated plan is answered again
            self._results.append((time.monotonic(), message))

    def _on_status(self, message: ControllerStatus) -> None:
        self.status = message

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            figures = {pair.key: pair.value for pair in status.values}
            self.diagnostics[status.name.rsplit("/", 1)[-1]] = (status.message, figures)


@contextmanager
def connected(check: Callable[[], None] = lambda: None) -> Iterator[Client]:
    """Yield a client; it is gone when the context ends.

    Args:
        check: called now and then while the client waits; what it raises ends the waiting.
    """
    context = rclpy.Context()
    rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
    executor = EventsExecutor(context=context)
    client = Client(context, executor, check)
    executor.add_node(client)
    try:
        yield client
    finally:
        executor.shutdown()
        client.destroy_node()
        context.try_shutdown()


def _began(answers: list[Answer]) -> bool:
    """Return whether a motion has begun; of two nodes' answers, "started" may outrun "planned"."""
    return any(answer.outcome == "started" for answer in answers)


def _timeout(sentence: str) -> RefusalError:
    return RefusalError(RefusalCode.TIMEOUT, sentence)
