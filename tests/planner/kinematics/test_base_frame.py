"""The base-frame model against two libraries that know nothing of it: Pinocchio, and adam on CasADi."""

import numpy as np
import pinocchio as pin
import pytest
from adam.casadi import KinDynComputations
from adam.core.constants import Representations

from aerial_model.numerics import rotation
from aerial_planner.kinematics.base_frame import base_frame_model

TOLERANCE = 1e-12


@pytest.fixture(scope="module")
def model(robot):
    return base_frame_model(robot)


@pytest.fixture(params=range(10))
def joints(request, robot):
    rng = np.random.default_rng(request.param)
    return rng.uniform(-1.5, 1.5, robot.n_joints), rng.normal(size=3), rng.normal(size=robot.n_joints)


def at_origin(q_j):
    return np.concatenate([np.zeros(3), rotation.IDENTITY, q_j])


def test_com_feet_and_inertia_agree_with_pinocchio(robot, model, joints):
    q_j, _, _ = joints
    data = robot.model.createData()
    pin.ccrba(robot.model, data, at_origin(q_j), np.zeros(robot.model.nv))
    np.testing.assert_allclose(np.asarray(model.com(q_j)).ravel(), data.com[0], atol=TOLERANCE)
    np.testing.assert_allclose(np.asarray(model.feet(q_j)).T, robot.contact_positions(at_origin(q_j)), atol=TOLERANCE)
    np.testing.assert_allclose(np.asarray(model.inertia(q_j)), data.Ig.inertia, atol=TOLERANCE)


def test_angular_momentum_agrees_with_pinocchio_whatever_the_base_velocity(robot, model, joints):
    q_j, omega, dq_j = joints
    data = robot.model.createData()
    v = np.concatenate([[1.0, -2.0, 3.0], omega, dq_j])
    pin.computeCentroidalMomentum(robot.model, data, at_origin(q_j), v)
    alpha = np.asarray(model.angular_momentum(q_j, omega, dq_j)).ravel()
    np.testing.assert_allclose(alpha, data.hg.angular, atol=TOLERANCE)


def test_foot_jacobians_agree_with_pinocchio(robot, model, joints):
    q_j, _, _ = joints
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, at_origin(q_j))
    pin.updateFramePlacements(robot.model, data)
    J = np.vstack(
        [pin.getFrameJacobian(robot.model, data, f, pin.LOCAL_WORLD_ALIGNED)[:3, 6:] for f in robot.contact_frames]
    )
    np.testing.assert_allclose(np.asarray(model.foot_jacobians(q_j).full()), J, atol=TOLERANCE)


def test_angular_momentum_agrees_with_adam(robot, model, joints):
    q_j, omega, dq_j = joints
    adam = KinDynComputations(str(robot.description.path), list(robot.joint_names))
    adam.set_frame_velocity_representation(Representations.MIXED_REPRESENTATION)
    A = np.asarray(adam.centroidal_momentum_matrix_fun()(np.eye(4), q_j).full())
    alpha = (A @ np.concatenate([np.zeros(3), omega, dq_j]))[3:]
    np.testing.assert_allclose(np.asarray(model.angular_momentum(q_j, omega, dq_j)).ravel(), alpha, atol=1e-9)
