import threading
import time

import pytest

from aerial_sim.ros.pacer import Pacer

PERIOD = 0.02  # [s]
PATIENCE = 10.0  # [s]


@pytest.fixture
def run():
    """Run a pacer until it has acted ``count`` times; return the pacer and when it acted."""

    def run(count, act=lambda: None):
        acted, done = [], threading.Event()

        def note():
            acted.append(time.monotonic())
            act()
            if len(acted) == count:
                done.set()

        pacer = Pacer(PERIOD, note)
        assert done.wait(PATIENCE)
        pacer.stop()
        return pacer, acted

    return run


def test_no_two_actions_are_closer_than_the_period_allows(run):
    """An early action would take from the time that the answer to the one before has."""
    _, acted = run(20)
    assert acted[-1] - acted[0] > 0.9 * 19 * PERIOD


def test_an_action_that_takes_too_long_shifts_what_follows_and_is_counted(run):
    pacer, _ = run(3, lambda: time.sleep(2 * PERIOD))
    assert pacer.late_ticks >= 2


def test_a_stopped_pacer_acts_no_more(run):
    _, acted = run(2)
    count = len(acted)
    time.sleep(3 * PERIOD)
    assert len(acted) == count
