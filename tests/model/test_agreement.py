"""One robot folder, two libraries: MuJoCo's model must be Pinocchio's, at random states."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from aerial_model.kinematics import Kinematics
from aerial_model.numerics.rotation import matrix
from aerial_model.robot.robot import BASE_ANGULAR, BASE_LINEAR, BASE_ORIENTATION, JOINT_POSITION, Robot
from aerial_model.values.terrain import Terrain
from aerial_sim.world import world

TOLERANCE = 1e-8  # SI units, relative to 1 or to the largest entry
MASS = {"mini_cheetah": 8.912, "mit_humanoid": 25.0}  # [kg]
STATES = range(20)


@pytest.fixture(scope="module", params=sorted(MASS))
def robot(request):
    return Robot.load(request.param)


@pytest.fixture(scope="module")
def built(robot):
    """The world without losses: damping and dry friction are the actuator's, tested with it."""
    built = world.build(robot, Terrain(), 0.001)
    built.model.dof_damping[:] = 0.0
    built.model.dof_frictionloss[:] = 0.0
    return built


@pytest.fixture(params=STATES)
def random_state(request, robot):
    """q, v, joint torque: within the joint stops, far above the floor."""
    random = np.random.default_rng(request.param)
    model = robot.model
    q = np.empty(model.nq)
    q[:3] = random.uniform([-1, -1, 4], [1, 1, 6])
    q[BASE_ORIENTATION] = _unit(random)
    q[JOINT_POSITION] = random.uniform(model.lowerPositionLimit[7:], model.upperPositionLimit[7:])
    v = random.normal(0, 3, model.nv)
    return q, v, random.uniform(-1, 1, robot.n_joints) * robot.actuators.torque_max


def _unit(random):
    x = random.normal(size=4)
    return x / np.linalg.norm(x)


def _mujoco_at(built, q, v, torque=0.0):
    """MuJoCo's data at a state given in Pinocchio's order; written independently of the simulator's own conversion."""
    data = mujoco.MjData(built.model)
    x, y, z, w = q[BASE_ORIENTATION]
    data.qpos[:7] = [*q[:3], w, x, y, z]
    data.qpos[built.joint_qpos] = q[7:]
    data.qvel[:3] = matrix(q[BASE_ORIENTATION]) @ v[BASE_LINEAR]
    data.qvel[3:6] = v[BASE_ANGULAR]
    data.qvel[built.joint_dof] = v[6:]
    data.ctrl[:] = torque
    # Self-contact would add forces that Pinocchio does not know.
    built.model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
    mujoco.mj_forward(built.model, data)
    mujoco.mj_subtreeVel(built.model, data)
    return data


def _velocity_map(built, q):
    """T ``(nv, nv)`` with (MuJoCo's qvel) = T (Pinocchio's v)."""
    nv = built.model.nv
    T = np.zeros((nv, nv))
    T[:3, :3] = matrix(q[BASE_ORIENTATION])
    T[3:6, 3:6] = np.eye(3)
    T[built.joint_dof, np.arange(6, nv)] = 1.0
    return T


def test_the_mass_is_that_of_the_source(robot, built):
    assert robot.mass == pytest.approx(MASS[robot.name], abs=TOLERANCE)
    assert built.model.body_mass.sum() == pytest.approx(MASS[robot.name], abs=TOLERANCE)


def test_the_centre_of_mass_agrees(robot, built, random_state):
    q, v, _ = random_state
    data = _mujoco_at(built, q, v)
    np.testing.assert_allclose(data.subtree_com[0], Kinematics(robot).at(q, v).com, atol=TOLERANCE)


def test_the_contact_points_agree(robot, built, random_state):
    q, v, _ = random_state
    data = _mujoco_at(built, q, v)
    np.testing.assert_allclose(data.geom_xpos[built.contact_geoms], robot.contact_positions(q), atol=TOLERANCE)


def test_the_mass_matrix_agrees_rotor_inertia_included(robot, built, random_state):
    q, v, _ = random_state
    data = _mujoco_at(built, q, v)
    M = np.zeros((built.model.nv, built.model.nv))
    mujoco.mj_fullM(built.model, data, M)
    T = _velocity_map(built, q)
    np.testing.assert_allclose(T.T @ M @ T, Kinematics(robot).at(q, v).M, atol=TOLERANCE)


def test_the_centroidal_momentum_agrees(robot, built, random_state):
    q, v, _ = random_state
    data = _mujoco_at(built, q, v)
    configuration = Kinematics(robot).at(q, v)
    np.testing.assert_allclose(data.subtree_linvel[0], configuration.com_velocity, atol=TOLERANCE)
    np.testing.assert_allclose(data.subtree_angmom[0], configuration.angular_momentum, atol=TOLERANCE)


def test_accelerations_under_gravity_and_torque_agree(robot, built, random_state):
    q, v, torque = random_state
    data = _mujoco_at(built, q, v, torque)
    vdot = pin.aba(robot.model, robot.model.createData(), q, v, np.concatenate([np.zeros(6), torque]))
    expected = _velocity_map(built, q) @ vdot
    expected[:3] += matrix(q[BASE_ORIENTATION]) @ pin.skew(v[BASE_ANGULAR]) @ v[BASE_LINEAR]
    np.testing.assert_allclose(data.qacc, expected, atol=TOLERANCE * np.abs(expected).max())


def test_joint_stops_agree(robot, built):
    ranges = built.model.jnt_range[[built.model.joint(name).id for name in robot.joint_names]]
    np.testing.assert_allclose(ranges[:, 0], robot.model.lowerPositionLimit[7:], atol=TOLERANCE)
    np.testing.assert_allclose(ranges[:, 1], robot.model.upperPositionLimit[7:], atol=TOLERANCE)
