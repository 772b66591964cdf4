"""The target to rest begins where the robot is and ends level over its support."""

from __future__ import annotations

import numpy as np
import pytest

from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ANGULAR
from aerial_wbic.behaviours.rest import RestTarget
from aerial_wbic.behaviours.support import support_centre, supported


@pytest.fixture
def rest_of(gains, robot):
    pose = robot.poses["home"]

    def rest_of(state, height=0.25):
        return RestTarget(state, 2.0, rate=10.0, com_height=height, depth=0.1, turn=0.4, pose=pose, gains=gains.hold)

    return rest_of


@pytest.mark.parametrize("seed", range(5))
def test_a_rest_begins_where_and_as_the_robot_moves(state_at, rest_of, seed):
    state = state_at(seed)
    body = rest_of(state).at(2.0, state).body
    np.testing.assert_allclose(body.com, state.com, atol=1e-9)
    np.testing.assert_allclose(body.com_velocity, state.com_velocity, atol=1e-9)
    np.testing.assert_allclose(body.com_acceleration, supported(state, np.zeros(3)), atol=1e-9)
    np.testing.assert_allclose(rotation.matrix(body.orientation), state.R_WB, atol=1e-9)
    np.testing.assert_allclose(body.angular_velocity, state.R_WB @ state.v[BASE_ANGULAR], atol=1e-9)


def test_a_robot_that_lands_low_rises_no_faster_after_a_higher_fall(state_at, rest_of):
    """The course of the height is that of the fall, caught, plus one that depends on how low the robot is alone."""
    rises = []
    for fall in (0.0, 2.0):
        state = state_at(moving=False)
        state.com_velocity[:] = [0.0, 0.0, -fall]
        low, level = (rest_of(state, height=state.com[2] - support_centre(state)[2] + d) for d in (0.1, 0.0))
        times = np.linspace(2.0, 3.0, 11)
        rises.append([low.at(t, state).body.com[2].copy() - level.at(t, state).body.com[2] for t in times])
    np.testing.assert_allclose(rises[1], rises[0], atol=1e-9)
    assert rises[0][0] == pytest.approx(0.0, abs=1e-9)
    assert rises[0][-1] == pytest.approx(0.1, abs=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_a_rest_ends_level_over_the_support_with_the_heading_it_had(state_at, rest_of, seed):
    state = state_at(seed)
    rest = rest_of(state, height=0.25)
    body = rest.at(rest.end + 2.0, state).body
    np.testing.assert_allclose(body.com, support_centre(state) + [0, 0, 0.25], atol=1e-6)
    assert rotation.tilt(body.orientation) < 1e-6
    assert rotation.heading(body.orientation) == pytest.approx(rotation.heading(state.base_orientation))


def test_a_rest_follows_its_support(state_at, rest_of):
    """The target moves with the feet: a touchdown that comes late, or a slip, makes no error jump."""
    here, there = state_at(1), state_at(2)
    rest = rest_of(here)
    offset = rest.at(2.1, here).body.com - support_centre(here)
    np.testing.assert_allclose(rest.at(2.1, there).body.com - support_centre(there), offset, atol=1e-12)


def test_a_rest_tells_when_it_is_reached(state_at, rest_of):
    state = state_at(moving=False)
    height = (state.com - support_centre(state))[2]
    assert rest_of(state, height).reached(state)
    assert not rest_of(state, 2 * height).reached(state)
