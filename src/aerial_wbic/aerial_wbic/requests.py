"""The request the controller works on, and the answers it owes: every request gets at least one."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from aerial_model.errors import InvalidPlanError, RefusalCode, RefusalError
from aerial_model.values.plan import Plan
from aerial_model.values.request import ControllerCommand
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.controller import Controller


class Outcome(StrEnum):
    """What the controller can say of a request; all but STARTED are final."""

    REFUSED = "refused"
    STARTED = "started"
    LANDED = "landed"
    FAILED = "failed"
    ABORTED = "aborted"


@dataclass(frozen=True)
class Answer:
    """One answer to one request; ``refusal`` is why, for an outcome that needs a reason."""

    request_id: str
    motion: str
    outcome: Outcome
    refusal: RefusalError | None = None


@dataclass(frozen=True)
class _Request:
    request_id: str
    motion: str

    def answer(self, outcome: Outcome, refusal: RefusalError | None = None) -> Answer:
        return Answer(self.request_id, self.motion, outcome, refusal)


class Requests:
    """Hands requests to a controller and tells how they end.

    Args:
        controller: that carries them out.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._running: _Request | None = None

    def execute(self, plan: Plan) -> list[Answer]:
        """Return the answers to a plan's arrival; one that comes again while it runs gets its answer again."""
        request = _Request(plan.request_id, plan.motion)
        if request == self._running:
            return [request.answer(Outcome.STARTED)]
        try:
            self._controller.accept(plan)
        except InvalidPlanError as error:
            return [request.answer(Outcome.REFUSED, RefusalError(RefusalCode.INVALID_PLAN, str(error)))]
        except RefusalError as refusal:
            return [request.answer(Outcome.REFUSED, refusal)]
        self._running = request
        return [request.answer(Outcome.STARTED)]

    def command(self, request_id: str, command: ControllerCommand) -> list[Answer]:
        """Return the answers to a selection that needs no plan."""
        request = _Request(request_id, command.value)
        interrupted = self._running
        try:
            self._carry_out(command)
        except RefusalError as refusal:
            return [request.answer(Outcome.REFUSED, refusal)]
        self._running = request
        answers = [request.answer(Outcome.STARTED)]
        if interrupted is not None:
            reason = RefusalError(RefusalCode.BUSY, f"called off by '{command.value}' before it left the ground")
            answers.insert(0, interrupted.answer(Outcome.ABORTED, reason))
        return answers

    def finish(self) -> list[Answer]:
        """Return the last answer to the request that runs, when the controller is done with it."""
        if self._running is None or not self._controller.settled:
            return []
        request, self._running = self._running, None
        expected = Phase.LIE if request.motion == ControllerCommand.LIE_DOWN else Phase.STAND
        if self._controller.phase is expected:
            return [request.answer(Outcome.LANDED)]
        if self._controller.phase is Phase.STOPPED:
            return [request.answer(Outcome.FAILED, RefusalError(RefusalCode.STOPPED, "an emergency stop ended it"))]
        reason = RefusalError(
            RefusalCode.FELL, "the robot did not come to stand: it tilted too far or its body lies too low"
        )
        return [request.answer(Outcome.FAILED, reason)]

    def _carry_out(self, command: ControllerCommand) -> None:
        controller = self._controller
        if command is ControllerCommand.ABORT:
            controller.abort()
        elif command is ControllerCommand.LIE_DOWN:
            controller.lie_down()
        elif command is ControllerCommand.STAND_UP or controller.phase is Phase.LIE:
            controller.stand_up()
        elif controller.phase is not Phase.STAND:  # told to stand in the middle of a motion
            controller.abort()
