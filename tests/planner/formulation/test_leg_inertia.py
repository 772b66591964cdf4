"""Torques with the legs' inertia against the equations of motion as Pinocchio solves them."""

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_TWIST, JOINT_VELOCITY
from aerial_planner.formulation.leg_inertia import LegInertia, inertial_torque

TOLERANCE = 1e-9  # [N·m]


@pytest.fixture(params=range(5))
def pose(request, robot):
    """Joint positions, joint accelerations and contact forces."""
    rng = np.random.default_rng(request.param)
    q_j = robot.poses["home"] + rng.uniform(-0.5, 0.5, robot.n_joints)
    return q_j, rng.normal(size=robot.n_joints), 50 * rng.normal(size=(robot.n_contacts, 3))


def test_torques_are_those_of_the_equations_of_motion_without_velocity_and_weight(robot, pose):
    q_j, ddq_j, force = pose
    q = np.concatenate([np.zeros(3), rotation.IDENTITY, q_j])
    model, data = robot.model, robot.model.createData()
    M = robot.mass_matrices(q_j[None])[0]
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    J = np.vstack([pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED)[:3] for f in robot.contact_frames])
    pushed = J.T @ force.ravel()
    base = np.linalg.solve(M[BASE_TWIST, BASE_TWIST], pushed[BASE_TWIST] - M[BASE_TWIST, JOINT_VELOCITY] @ ddq_j)
    tau = (M @ np.concatenate([base, ddq_j]) - pushed)[JOINT_VELOCITY]

    inertia = LegInertia.at(robot, q_j[None])
    arguments = (inertia.joint[0], inertia.wrench_share[0], ddq_j, force.T, robot.contact_positions(q).T)
    found = np.asarray(inertial_torque(*map(ca.DM, arguments))).ravel() - J[:, JOINT_VELOCITY].T @ force.ravel()
    np.testing.assert_allclose(found, tau, atol=TOLERANCE)


def test_without_contacts_what_accelerates_the_legs_turns_the_body(robot, pose):
    q_j, ddq_j, _ = pose
    inertia, nothing = LegInertia.at(robot, q_j[None]), ca.DM.zeros(3, 0)
    tau = inertial_torque(ca.DM(inertia.joint[0]), ca.DM(inertia.wrench_share[0]), ca.DM(ddq_j), nothing, nothing)
    M = robot.mass_matrices(q_j[None])[0]
    acceleration = np.linalg.solve(M, np.concatenate([np.zeros(6), np.asarray(tau).ravel()]))
    np.testing.assert_allclose(acceleration[JOINT_VELOCITY], ddq_j, atol=1e-6)
