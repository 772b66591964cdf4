import numpy as np
import pytest

from aerial_model.robot.posture import crouch_depth, points_from_com, reaching
from aerial_model.robot.robot import Robot


@pytest.fixture(scope="module", params=["mini_cheetah", "mit_humanoid"])
def robot(request):
    return Robot.load(request.param)


def test_a_pose_reaches_the_points_it_has(robot):
    points = points_from_com(robot, robot.poses["home"])
    q_j, left = reaching(robot, points, robot.poses["landing"])
    assert left < 1e-3
    np.testing.assert_allclose(points_from_com(robot, q_j), points, atol=2e-3)


def test_what_is_out_of_reach_is_missed_by_what_is_missing(robot):
    points = points_from_com(robot, robot.poses["home"]) - [0.0, 0.0, 2.0]
    q_j, left = reaching(robot, points, robot.poses["home"])
    assert left > 1.0
    low, high = robot.planning_range
    assert np.all((q_j >= low) & (q_j <= high))


def test_legs_bend_as_deep_as_their_range_lets_them(robot):
    depth = crouch_depth(robot, robot.poses["home"])
    points = points_from_com(robot, robot.poses["home"])
    points -= [*points[:, :2].mean(axis=0), 0.0]
    assert 0.05 < depth < -points[:, 2].max()
    deeper = points + [0.0, 0.0, 1.05 * depth + 0.005]
    assert reaching(robot, deeper, robot.poses["home"])[1] > 1e-3
