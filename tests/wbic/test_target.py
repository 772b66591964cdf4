"""Targets: the way to rest begins where the robot is and ends level over its support; a plan is followed."""

from __future__ import annotations

import numpy as np
import pytest

from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ANGULAR
from aerial_model.values.frame import StartFrame
from aerial_wbic.behaviours.support import support_centre, supported
from aerial_wbic.target import Fold, Following, Hold


@pytest.fixture
def hold_of(gains, robot):
    pose = robot.poses["home"]

    def hold_of(state, height=0.25):
        return Hold(state, 2.0, rate=10.0, com_height=height, depth=0.1, turn=0.4, pose=pose, gains=gains.hold)

    return hold_of


@pytest.mark.parametrize("seed", range(5))
def test_a_hold_begins_where_and_as_the_robot_moves(state_at, hold_of, seed):
    state = state_at(seed)
    body = hold_of(state).at(2.0, state).body
    np.testing.assert_allclose(body.com, state.com, atol=1e-9)
    np.testing.assert_allclose(body.com_velocity, state.com_velocity, atol=1e-9)
    np.testing.assert_allclose(body.com_acceleration, supported(state, np.zeros(3)), atol=1e-9)
    np.testing.assert_allclose(rotation.matrix(body.orientation), state.R_WB, atol=1e-9)
    np.testing.assert_allclose(body.angular_velocity, state.R_WB @ state.v[BASE_ANGULAR], atol=1e-9)


def test_a_robot_that_lands_low_rises_no_faster_after_a_higher_fall(state_at, hold_of):
    """The course of the height is that of the fall, caught, plus one that depends on how low the robot is alone."""
    rises = []
    for fall in (0.0, 2.0):
        state = state_at(moving=False)
        state.com_velocity[:] = [0.0, 0.0, -fall]
        low, level = (hold_of(state, height=state.com[2] - support_centre(state)[2] + d) for d in (0.1, 0.0))
        times = np.linspace(2.0, 3.0, 11)
        rises.append([low.at(t, state).body.com[2].copy() - level.at(t, state).body.com[2] for t in times])
    np.testing.assert_allclose(rises[1], rises[0], atol=1e-9)
    assert rises[0][0] == pytest.approx(0.0, abs=1e-9)
    assert rises[0][-1] == pytest.approx(0.1, abs=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_a_hold_ends_level_over_the_support_with_the_heading_it_had(state_at, hold_of, seed):
    state = state_at(seed)
    hold = hold_of(state, height=0.25)
    body = hold.at(hold.end + 2.0, state).body
    np.testing.assert_allclose(body.com, support_centre(state) + [0, 0, 0.25], atol=1e-6)
    assert rotation.tilt(body.orientation) < 1e-6
    assert rotation.heading(body.orientation) == pytest.approx(rotation.heading(state.base_orientation))


def test_a_hold_follows_its_support(state_at, hold_of):
    """The target moves with the feet: a touchdown that comes late, or a slip, makes no error jump."""
    here, there = state_at(1), state_at(2)
    hold = hold_of(here)
    offset = hold.at(2.1, here).body.com - support_centre(here)
    np.testing.assert_allclose(hold.at(2.1, there).body.com - support_centre(there), offset, atol=1e-12)


def test_a_hold_tells_when_it_is_reached(state_at, hold_of):
    state = state_at(moving=False)
    height = (state.com - support_centre(state))[2]
    assert hold_of(state, height).reached(state)
    assert not hold_of(state, 2 * height).reached(state)


def test_a_fold_goes_from_the_joints_as_they_are_to_the_pose(robot, state_at):
    state = state_at(3)
    fold = Fold(state, 1.0, rate=5.0, pose=robot.poses["tuck"])
    begin, end = fold.at(1.0, state), fold.at(fold.end + 2.0, state)
    np.testing.assert_allclose(begin.joint_position, state.q[7:])
    np.testing.assert_allclose(begin.joint_velocity, state.v[6:])
    np.testing.assert_allclose(end.joint_position, robot.poses["tuck"], atol=1e-3)


def test_a_plan_gives_its_sample_in_world_axes(hop, gains):
    turned = hop.placed(StartFrame(origin=np.array([1.0, 2.0, 0.0]), heading=0.5))
    sample = turned.sample(0.3)
    target = Following(turned.track, gains.follow).at(0.3)
    R = rotation.matrix(sample.q[3:7])
    np.testing.assert_allclose(target.body.angular_velocity, R @ sample.v[BASE_ANGULAR])
    np.testing.assert_allclose(target.body.com, sample.com)
    np.testing.assert_array_equal(target.joint_position, sample.q[7:])
    np.testing.assert_array_equal(target.force, sample.force)
    assert target.body.gains == gains.follow
    assert target.contact.all()


def test_who_waits_for_a_contact_keeps_the_joints_still(hop, gains):
    following = Following(hop.track, gains.follow)
    going, landing = following.at(0.3).joint_velocity.copy(), following.at(0.3, waiting=True)
    assert going.any()
    assert not landing.joint_velocity.any()
    assert not landing.joint_acceleration.any()
