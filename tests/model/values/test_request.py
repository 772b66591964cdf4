import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerial_model.errors import ConfigurationError
from aerial_model.numerics import rotation
from aerial_model.robot.robot import Robot
from aerial_model.values.request import LOWER_MARGIN, UPPER_MARGIN, MotionRequest

ROBOT = Robot.load("mini_cheetah")
STANDING = ROBOT.contact_positions(ROBOT.standing_configuration())
LANDING = ROBOT.contact_positions(ROBOT.standing_configuration("landing"))
TOLERANCE = 1e-9  # [m]

angles = st.floats(-np.pi, np.pi)


def towards(direction, distance, height):
    return MotionRequest(
        motion="jump", displacement=[distance * np.cos(direction), distance * np.sin(direction), height]
    )


def landing_feet(request):
    return request.displacement + LANDING @ rotation.matrix(rotation.about_z(request.yaw)).T


@given(direction=angles, distance=st.floats(0.6, 1.2), height=st.floats(0.05, 0.4))
def test_all_landing_feet_stand_on_the_platform_and_no_standing_foot_under_it(direction, distance, height):
    request = towards(direction, distance, height).with_platform(ROBOT)
    box = request.terrain.boxes[0]
    assert np.all(box.covers(landing_feet(request), margin=-UPPER_MARGIN + TOLERANCE))
    assert not np.any(box.covers(STANDING, margin=LOWER_MARGIN - TOLERANCE))
    assert box.top == pytest.approx(height)


@given(direction=angles, distance=st.floats(0.6, 1.2), height=st.floats(-0.4, -0.05))
def test_a_step_down_leaves_the_stance_on_top_and_the_landing_feet_on_the_floor(direction, distance, height):
    request = towards(direction, distance, height).with_platform(ROBOT)
    assert np.all(request.terrain.boxes[0].covers(STANDING, margin=-LOWER_MARGIN + TOLERANCE))
    np.testing.assert_allclose(request.terrain.height(landing_feet(request), margin=LOWER_MARGIN - TOLERANCE), height)


def test_a_platform_too_near_for_both_margins_has_its_edge_halfway():
    near, far = towards(0.0, 0.4, 0.1).with_platform(ROBOT), towards(0.0, 0.5, 0.1).with_platform(ROBOT)
    standing, landing = STANDING[:, 0].max() + LOWER_MARGIN, 0.4 + LANDING[:, 0].min() - UPPER_MARGIN
    assert near_edge(near) == pytest.approx((standing + landing) / 2)
    assert near_edge(far) > near_edge(near)


def test_a_turned_landing_moves_the_platform_to_where_the_turned_feet_stand():
    request = MotionRequest(motion="jump", displacement=[0.6, 0.0, 0.1], yaw=np.pi / 2).with_platform(ROBOT)
    assert near_edge(request) == pytest.approx(0.6 + LANDING[:, 1].min() - UPPER_MARGIN)


def test_a_given_edge_is_taken():
    assert near_edge(towards(0.0, 0.6, 0.2).with_platform(ROBOT, edge=0.25)) == pytest.approx(0.25)


def test_a_given_height_need_not_be_the_goals():
    assert towards(0.0, 0.6, 0.0).with_platform(ROBOT, height=0.2, edge=2.0).terrain.boxes[0].top == pytest.approx(0.2)


def test_a_hurdle_stands_midway_between_standing_and_landing_feet():
    box = towards(0.0, 0.7, 0.0).with_hurdle(ROBOT, 0.1).terrain.boxes[0]
    np.testing.assert_allclose(box.centre, [0.35, 0.0, 0.05])


def test_a_given_edge_is_the_hurdles_near_face():
    assert near_edge(towards(0.0, 0.7, 0.0).with_hurdle(ROBOT, 0.1, edge=0.3)) == pytest.approx(0.3)


def test_a_platform_without_height_is_refused():
    with pytest.raises(ConfigurationError, match="height other than 0"):
        towards(0.0, 0.6, 0.0).with_platform(ROBOT)


@pytest.mark.parametrize("height", [0.0, -0.1, np.nan, np.inf])
def test_a_hurdle_without_positive_height_is_refused(height):
    with pytest.raises(ConfigurationError, match="positive height"):
        towards(0.0, 0.6, 0.0).with_hurdle(ROBOT, height)


@given(direction=angles, distance=st.floats(0.7, 1.2), width=st.floats(0.05, 0.15))
def test_no_foot_stands_or_lands_in_a_gap_that_fits(direction, distance, width):
    terrain = towards(direction, distance, 0.0).with_gap(ROBOT, width).terrain
    feet = np.vstack([STANDING, landing_feet(towards(direction, distance, 0.0))])
    np.testing.assert_allclose(terrain.height(feet), 0.0, atol=TOLERANCE)


def test_a_gap_too_wide_leaves_room_for_the_standing_feet():
    near = towards(0.0, 0.6, 0.0).with_gap(ROBOT, 0.9).terrain.boxes[0]
    assert np.all(near.covers(STANDING, margin=-UPPER_MARGIN + TOLERANCE))


def test_a_given_edge_is_where_the_gap_begins_and_the_far_bank_is_as_high_as_the_goal():
    near, far = towards(0.0, 0.9, 0.1).with_gap(ROBOT, 0.2, edge=0.3).terrain.boxes
    assert near.centre[0] + near.size[0] / 2 == pytest.approx(0.3)
    assert far.centre[0] - far.size[0] / 2 == pytest.approx(0.5)
    assert far.top == pytest.approx(0.1)


@pytest.mark.parametrize("width", [0.0, -0.1, np.nan, np.inf])
def test_a_gap_without_positive_width_is_refused(width):
    with pytest.raises(ConfigurationError, match="positive width"):
        towards(0.0, 0.6, 0.0).with_gap(ROBOT, width)


def test_a_landing_below_the_bottom_of_a_gap_is_refused():
    with pytest.raises(ConfigurationError, match="below it"):
        towards(0.0, 0.6, -0.4).with_gap(ROBOT, 0.2)


def near_edge(request):
    box = request.terrain.boxes[0]
    return box.centre[0] - box.size[0] / 2
