import dataclasses

import numpy as np
import pytest

from aerial_sim.exchange import Exchange
from aerial_sim.robot_side.watchdog import HOLD_PERIODS
from aerial_sim.simulation import Simulation


@pytest.fixture
def exchange(robot):
    return Exchange(Simulation(robot, noise="off"))


@pytest.fixture
def answer(exchange, hold):
    """Offer the command that answers the present state, or one that is ``late`` by some states."""

    def answer(late=0):
        exchange.offer(dataclasses.replace(hold, state_sequence=exchange.measurement.sequence - late))

    return answer


def test_time_waits_for_a_first_command(exchange, answer):
    assert not exchange.free
    answer()
    assert exchange.free


def test_a_command_in_time_is_no_missed_tick(exchange, answer):
    for _ in range(10):
        answer()
        exchange.advance()
    assert (exchange.ticks, exchange.missed_ticks) == (10, 0)


def test_a_command_for_an_older_state_is_a_missed_tick(exchange, answer):
    answer()
    exchange.advance()
    answer(late=1)
    exchange.advance()
    assert (exchange.ticks, exchange.missed_ticks) == (2, 1)


def test_an_overtaken_command_is_dropped(exchange, answer):
    for _ in range(3):
        answer()
        exchange.advance()
    answer()
    answer(late=2)
    assert exchange.answered


def test_a_command_from_before_a_reset_is_dropped(exchange, answer):
    answer(late=-5)
    assert not exchange.started


def test_the_last_command_holds_for_some_ticks_then_the_joints_only_damp(exchange, torque_command):
    exchange.offer(torque_command(1.0))
    for _ in range(HOLD_PERIODS + 1):
        exchange.advance()
        np.testing.assert_allclose(exchange.measurement.joint_torque, 1.0)
    exchange.advance()
    assert np.all(exchange.measurement.joint_torque < 0.9)


def test_commands_that_keep_coming_late_still_act(exchange, torque_command):
    for _ in range(3 * HOLD_PERIODS):
        exchange.offer(
            dataclasses.replace(torque_command(1.0), state_sequence=max(exchange.measurement.sequence - 1, 0))
        )
        exchange.advance()
    np.testing.assert_allclose(exchange.measurement.joint_torque, 1.0)
    assert exchange.missed_ticks == 3 * HOLD_PERIODS - 1


def test_a_pause_stops_time_and_grants_let_some_pass(exchange, answer):
    answer()
    exchange.paused = True
    assert not exchange.free
    exchange.granted = 2
    exchange.advance()
    assert exchange.free
    exchange.advance()
    assert not exchange.free


def test_time_waits_for_a_plan(exchange, answer):
    answer()
    exchange.awaited = "request"
    assert not exchange.free


def test_a_reset_waits_for_a_first_command_again(exchange, answer):
    answer()
    exchange.advance()
    exchange.reset(0)
    assert not exchange.started
    assert (exchange.ticks, exchange.missed_ticks, exchange.measurement.sequence) == (0, 0, 0)
