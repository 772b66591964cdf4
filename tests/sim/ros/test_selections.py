"""Which selections lock-step waits for, and when a motion is held to run; the exchange is the real one, paused."""

import pytest

from aerial_msgs.msg import MotionResult, MotionSelection
from aerial_sim.exchange import Exchange
from aerial_sim.ros import selections as subject
from aerial_sim.ros.selections import MOTION_TIME_MAX, Selections
from aerial_sim.simulation import Simulation

JUMP = MotionSelection(motion="jump", request_id="one")


@pytest.fixture
def exchange(robot):
    return Exchange(Simulation(robot, noise="off"))


@pytest.fixture
def selections(exchange):
    return Selections(exchange, lock_step=True)


def result(outcome, request_id="one"):
    return MotionResult(request_id=request_id, outcome=outcome)


def test_lock_step_waits_for_a_plan_and_then_for_its_start(exchange, selections):
    selections.on_selection(JUMP)
    assert exchange.awaited == "one"
    selections.on_result(result(MotionResult.PLANNED))
    assert exchange.awaited == "one"
    selections.on_result(result(MotionResult.STARTED))
    assert exchange.awaited is None


def test_a_refusal_ends_the_wait(exchange, selections):
    selections.on_selection(JUMP)
    selections.on_result(result(MotionResult.REFUSED))
    assert exchange.awaited is None


def test_an_answer_to_somebody_else_does_not_end_the_wait(exchange, selections):
    selections.on_selection(JUMP)
    selections.on_result(result(MotionResult.REFUSED, "two"))
    assert exchange.awaited == "one"


def test_a_refusal_may_outrun_its_selection(exchange, selections):
    selections.on_result(result(MotionResult.REFUSED))
    selections.on_selection(JUMP)
    assert exchange.awaited is None


def test_time_waits_for_nothing_that_needs_no_plan(exchange, selections):
    selections.on_selection(MotionSelection(motion="lie_down", request_id="one"))
    assert exchange.awaited is None


def test_real_time_waits_for_nobody(exchange):
    Selections(exchange, lock_step=False).on_selection(JUMP)
    assert exchange.awaited is None


def test_a_plan_is_not_waited_for_for_ever(exchange, selections, monkeypatch):
    monkeypatch.setattr(subject, "PLAN_TIMEOUT", -1.0)
    selections.on_selection(JUMP)
    assert selections.overdue() == "one"
    assert exchange.awaited is None
    assert selections.overdue() is None


@pytest.mark.parametrize("outcome", subject.FINAL)
def test_a_motion_runs_from_its_start_to_its_last_answer(selections, outcome):
    assert not selections.motion_runs
    selections.on_result(result(MotionResult.STARTED))
    assert selections.motion_runs
    selections.on_result(result(outcome, "two"))
    assert selections.motion_runs
    selections.on_result(result(outcome))
    assert not selections.motion_runs


def test_a_motion_whose_end_nobody_reports_is_over_some_day(exchange, selections):
    selections.on_result(result(MotionResult.STARTED))
    exchange.simulation._ticks = round(MOTION_TIME_MAX / exchange.simulation.control_dt) + 1
    assert not selections.motion_runs


def test_a_reset_ends_every_motion(selections):
    selections.on_result(result(MotionResult.STARTED))
    selections.reset()
    assert not selections.motion_runs
