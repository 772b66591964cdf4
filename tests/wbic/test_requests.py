"""Every request gets its answers, whatever becomes of it."""

from __future__ import annotations

import dataclasses

import pytest

from aerial_model.errors import InvalidPlanError, RefusalCode, RefusalError
from aerial_model.values.request import ControllerCommand
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.requests import Outcome, Requests


class Robotless:
    """A controller that does what it is told at once, or refuses."""

    def __init__(self):
        self.phase, self.settled, self.calls, self.error = Phase.STAND, True, [], None

    def _told(self, name):
        if self.error:
            raise self.error
        self.calls.append(name)

    def accept(self, plan):
        self._told("accept")
        self.phase, self.settled = Phase.TAKE_OFF, False

    def abort(self):
        self._told("abort")

    def lie_down(self):
        self._told("lie_down")

    def stand_up(self):
        self._told("stand_up")


@pytest.fixture
def controller():
    return Robotless()


@pytest.fixture
def requests(controller):
    return Requests(controller)


@pytest.fixture
def plan(hop):
    return dataclasses.replace(hop, request_id="seven", motion="jump")


def outcomes(answers):
    return [(answer.request_id, answer.outcome) for answer in answers]


def settle(controller, phase):
    controller.phase, controller.settled = phase, True


def test_a_plan_starts_and_lands(requests, controller, plan):
    assert outcomes(requests.execute(plan)) == [("seven", Outcome.STARTED)]
    assert requests.finish() == []
    settle(controller, Phase.STAND)
    assert outcomes(requests.finish()) == [("seven", Outcome.LANDED)]
    assert requests.finish() == []


def test_a_plan_that_comes_again_while_it_runs_gets_its_answer_again(requests, controller, plan):
    assert requests.execute(plan) == requests.execute(plan)
    assert controller.calls == ["accept"]


@pytest.mark.parametrize(("phase", "code"), [(Phase.LIE, RefusalCode.FELL), (Phase.STOPPED, RefusalCode.STOPPED)])
def test_a_motion_that_ends_badly_fails(requests, controller, plan, phase, code):
    requests.execute(plan)
    settle(controller, phase)
    (answer,) = requests.finish()
    assert answer.outcome is Outcome.FAILED
    assert answer.refusal.code is code


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (InvalidPlanError("plan field v: not finite"), RefusalCode.INVALID_PLAN),
        (RefusalError(RefusalCode.BUSY, "motion 'jump' still runs"), RefusalCode.BUSY),
    ],
)
def test_a_plan_that_is_not_accepted_is_refused_with_the_reason(requests, controller, plan, error, code):
    controller.error = error
    (answer,) = requests.execute(plan)
    assert answer.outcome is Outcome.REFUSED
    assert (answer.refusal.code, answer.refusal.reason) == (code, str(error))
    assert requests.finish() == []


def test_an_abort_ends_the_motion_and_is_answered_itself(requests, controller, plan):
    requests.execute(plan)
    answers = requests.command("eight", ControllerCommand.ABORT)
    assert outcomes(answers) == [("seven", Outcome.ABORTED), ("eight", Outcome.STARTED)]
    settle(controller, Phase.STAND)
    assert outcomes(requests.finish()) == [("eight", Outcome.LANDED)]


def test_a_refused_command_leaves_the_motion_running(requests, controller, plan):
    requests.execute(plan)
    controller.error = RefusalError(RefusalCode.BUSY, "too late")
    assert outcomes(requests.command("eight", ControllerCommand.ABORT)) == [("eight", Outcome.REFUSED)]
    settle(controller, Phase.STAND)
    assert outcomes(requests.finish()) == [("seven", Outcome.LANDED)]


def test_lying_down_ends_on_the_ground(requests, controller):
    requests.command("nine", ControllerCommand.LIE_DOWN)
    settle(controller, Phase.LIE)
    assert outcomes(requests.finish()) == [("nine", Outcome.LANDED)]


@pytest.mark.parametrize(("phase", "call"), [(Phase.LIE, ["stand_up"]), (Phase.STAND, []), (Phase.TAKE_OFF, ["abort"])])
def test_to_stand_is_whatever_leads_there(requests, controller, phase, call):
    settle(controller, phase)
    requests.command("ten", ControllerCommand.STAND)
    assert controller.calls == call
    settle(controller, Phase.STAND)
    assert outcomes(requests.finish()) == [("ten", Outcome.LANDED)]
