import dataclasses

import numpy as np
import pytest

from aerial_sim.robot_side.watchdog import HOLD_PERIODS, SILENCE_DAMPING, Watchdog


@pytest.fixture
def watchdog(robot):
    return Watchdog(robot.n_joints)


@pytest.fixture
def numbered(hold):
    """A command that answers state number ``numbered(sequence)``."""
    return lambda sequence: dataclasses.replace(hold, state_sequence=sequence)


def test_without_a_command_the_joints_are_only_damped(watchdog):
    command = watchdog.in_force(0)
    assert not watchdog.fed
    assert np.all(command.damping == SILENCE_DAMPING)
    assert not np.any([command.torque, command.stiffness, command.velocity])


@pytest.mark.parametrize("age", [0, 1, HOLD_PERIODS])
def test_a_command_acts_until_it_is_too_old(watchdog, numbered, age):
    command = numbered(3)
    watchdog.offer(command, 3)
    assert watchdog.in_force(3 + age) is command
    assert watchdog.age(3 + age) == age


def test_a_command_that_is_too_old_is_replaced_by_damping(watchdog, numbered):
    watchdog.offer(numbered(3), 3)
    assert np.all(watchdog.in_force(3 + HOLD_PERIODS + 1).damping == SILENCE_DAMPING)


def test_a_command_that_was_overtaken_is_dropped(watchdog, numbered):
    newer = numbered(5)
    watchdog.offer(newer, 6)
    watchdog.offer(numbered(4), 6)
    assert watchdog.in_force(6) is newer


def test_a_command_for_a_later_state_is_from_before_a_reset(watchdog, numbered):
    watchdog.offer(numbered(7), 2)
    assert not watchdog.fed


def test_a_cleared_watchdog_takes_commands_that_would_have_been_overtaken(watchdog, numbered):
    watchdog.offer(numbered(5), 6)
    watchdog.clear()
    first = numbered(0)
    watchdog.offer(first, 0)
    assert watchdog.in_force(0) is first
