import dataclasses

import numpy as np
import pytest

from aerial_sim.robot_side.session import HOLD_TICKS, Session
from aerial_sim.simulation import Simulation


@pytest.fixture
def session(robot):
    return Session(Simulation(robot, noise="off"))


@pytest.fixture
def answer(session, hold):
    """Offer the command that answers the present state, or one that is ``late`` by some states."""

    def answer(late=0):
        session.offer(dataclasses.replace(hold, state_sequence=session.measurement.sequence - late))

    return answer


def test_time_waits_for_a_first_command(session, answer):
    assert not session.free
    answer()
    assert session.free


def test_a_command_in_time_is_no_missed_tick(session, answer):
    for _ in range(10):
        answer()
        session.advance()
    assert (session.ticks, session.missed_ticks) == (10, 0)


def test_a_command_for_an_older_state_is_a_missed_tick(session, answer):
    answer()
    session.advance()
    answer(late=1)
    session.advance()
    assert (session.ticks, session.missed_ticks) == (2, 1)


def test_an_overtaken_command_is_dropped(session, answer):
    for _ in range(3):
        answer()
        session.advance()
    answer()
    answer(late=2)
    assert session.answered


def test_a_command_from_before_a_reset_is_dropped(session, answer):
    answer(late=-5)
    assert not session.started


def test_the_last_command_holds_for_some_ticks_then_the_joints_only_damp(session, torque_command):
    session.offer(torque_command(1.0))
    for _ in range(HOLD_TICKS + 1):
        session.advance()
        np.testing.assert_allclose(session.measurement.joint_torque, 1.0)
    session.advance()
    assert np.all(session.measurement.joint_torque < 0.9)


def test_commands_that_keep_coming_late_still_act(session, torque_command):
    for _ in range(3 * HOLD_TICKS):
        session.offer(dataclasses.replace(torque_command(1.0), state_sequence=max(session.measurement.sequence - 1, 0)))
        session.advance()
    np.testing.assert_allclose(session.measurement.joint_torque, 1.0)
    assert session.missed_ticks == 3 * HOLD_TICKS - 1


def test_a_pause_stops_time_and_grants_let_some_pass(session, answer):
    answer()
    session.paused = True
    assert not session.free
    session.granted = 2
    session.advance()
    assert session.free
    session.advance()
    assert not session.free


def test_time_waits_for_a_plan(session, answer):
    answer()
    session.awaited = "request"
    assert not session.free


def test_a_reset_waits_for_a_first_command_again(session, answer):
    answer()
    session.advance()
    session.reset(0)
    assert not session.started
    assert (session.ticks, session.missed_ticks, session.measurement.sequence) == (0, 0, 0)
