import numpy as np
import pinocchio as pin
import pytest

from aerial_model.posture import crouch_depth, giving_way, points_from_com, reaching
from aerial_model.robot import Robot


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


def test_limbs_give_way_as_fast_as_their_length_changes(robot):
    def lengths(pose):
        points = robot.contact_positions(np.concatenate([np.zeros(6), [1.0], pose]))
        links = np.unique(robot.contact_links)
        model, data = robot.model, robot.model.createData()
        pin.forwardKinematics(model, data, np.concatenate([np.zeros(6), [1.0], pose]))
        hips = [data.oMi[list(model.supports[int(link)])[2]].translation for link in links]
        centres = [points[robot.contact_links == link].mean(axis=0) for link in links]
        return np.array([np.linalg.norm(c - h) for c, h in zip(centres, hips, strict=True)])

    pose, step = robot.poses["landing"], 1e-6
    slopes = [(lengths(pose + d) - lengths(pose - d)) / (2 * step) for d in step * np.eye(robot.n_joints)]
    np.testing.assert_allclose(giving_way(robot, pose), np.linalg.norm(slopes, axis=0), atol=1e-8)


def test_a_straight_limb_does_not_give_way(robot):
    straight = robot.poses["home"].copy()
    for k, name in enumerate(robot.joint_names):
        if not ("shoulder" in name or "elbow" in name):
            straight[k] = 0.0
    assert np.all(giving_way(robot, straight) < 0.4 * giving_way(robot, robot.poses["home"]))
