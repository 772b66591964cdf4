"""Inverse kinematics against the forward kinematics of Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.numerics import rotation
from aerial_planner.kinematics import InverseKinematics, base_frame_model

POSITION_TOLERANCE = 1e-4  # [m]


@pytest.fixture(scope="module")
def ik(robot):
    return InverseKinematics(robot, base_frame_model(robot))


def feet_from_com(robot, q_j):
    """Feet from the centre of mass ``(n_c, 3)`` [m], the base at the origin."""
    q = np.concatenate([np.zeros(3), rotation.IDENTITY, q_j])
    return robot.contact_positions(q) - pin.centerOfMass(robot.model, robot.model.createData(), q)


def test_feet_are_where_they_should_be(robot, ik):
    rng = np.random.default_rng(0)
    low, high = robot.planning_range
    poses = np.clip(robot.poses["home"] + rng.uniform(-0.3, 0.3, size=(20, robot.n_joints)), low, high)
    wanted = np.array([feet_from_com(robot, q_j) for q_j in poses])
    found = ik.solve(wanted, robot.poses["home"])
    np.testing.assert_allclose([feet_from_com(robot, q_j) for q_j in found], wanted, atol=POSITION_TOLERANCE)


def test_feet_out_of_reach_leave_the_joints_within_their_range(robot, ik):
    wanted = feet_from_com(robot, robot.poses["home"]) - [0.0, 0.0, 1.0]
    found = ik.solve(wanted[None], robot.poses["home"])[0]
    low, high = robot.planning_range
    assert np.all((low <= found) & (found <= high))
