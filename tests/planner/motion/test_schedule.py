"""The contact schedule of a take-off whose contacts and footholds are given."""

import numpy as np
import pytest

from aerial_planner.motion.motion import load_motion
from aerial_planner.motion.schedule import contact_schedule

from ..conftest import jump
from ..trot import pair, sequence

DT, M = 0.02, 16


def scheduled(robot, *phases):
    q = robot.standing_configuration()
    given = sequence(robot, q, *phases)
    return contact_schedule(jump(0.5, 0.0), load_motion("jump", robot), robot, DT, M, sequence=given)


def test_contacts_and_footholds_follow_the_sequence(robot):
    first, second = pair(robot, "fr", "hl"), pair(robot, "fl", "hr")
    schedule = scheduled(robot, (0.12, first, 0.0), (0.06, second, 0.1))
    np.testing.assert_array_equal(schedule.contact, [first] * 6 + [second] * 3)
    np.testing.assert_array_equal(schedule.phase, [0] * 6 + [1] * 3)
    np.testing.assert_allclose(schedule.foothold[6:, :, 0] - schedule.foothold[:3, :, 0], 0.1)


@pytest.mark.parametrize("duration", [0.13, 0.135, 0.004])
def test_the_take_off_takes_exactly_as_long_as_the_sequence(robot, duration):
    schedule = scheduled(robot, (duration, np.ones(4, dtype=bool), 0.0))
    assert schedule.take_off_time == pytest.approx(duration, abs=1e-12)
    assert abs(schedule.dt - DT) <= DT / 2 or len(schedule.contact) == 1


def test_without_a_sequence_points_stand_where_they_start(robot):
    schedule = contact_schedule(jump(0.5, 0.0), load_motion("jump", robot), robot, DT, M)
    assert schedule.foothold is None
    assert schedule.contact.all()
