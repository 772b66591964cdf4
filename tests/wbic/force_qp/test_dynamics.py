"""Torques do to the robot what was computed: forward dynamics of Pinocchio and of MuJoCo are asked, not the controller's own."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from aerial_model.kinematics import Kinematics
from aerial_model.robot.robot import BASE_ANGULAR, BASE_LINEAR, JOINT_POSITION, JOINT_VELOCITY
from aerial_model.values.terrain import Terrain
from aerial_sim.world import world
from aerial_wbic.behaviours.support import shared_load
from aerial_wbic.force_qp.optimization import ForceOptimization
from aerial_wbic.tasks.limbs import Limbs
from aerial_wbic.tasks.ordering import task_ordering

TOLERANCE = 1e-6  # relative to the largest acceleration
PHYSICS_DT = 0.001  # [s]
PUSH = np.array([4.0, -3.0, 12.0])  # asked of the centre of mass [m/s²]
CONTACTS = {
    "no": np.zeros(4, dtype=bool),
    "one": np.array([False, True, False, False]),
    "two": np.array([True, False, False, True]),
    "four": np.ones(4, dtype=bool),
}
STRAIGHT = [0.0, 1e-6, 0.03]  # knee angles [rad]

in_contact = pytest.mark.parametrize("contact", CONTACTS.values(), ids=CONTACTS)


@pytest.fixture(scope="module")
def built(robot):
    """MuJoCo's robot, without friction in the joints and without any constraint: forces are applied by hand."""
    built = world.build(robot, Terrain(), PHYSICS_DT)
    built.model.dof_damping[:] = 0.0
    built.model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return built


@pytest.fixture
def answer(robot, gains, commanded):
    """q̈, forces and torques of one tick that asks for a push, which one or two feet cannot give, with a tilted base."""
    optimization = ForceOptimization(robot, gains.weight_base, gains.weight_force)
    limbs, ordering = Limbs(robot), task_ordering(gains)

    def answer(state, target_at, contact):
        target = target_at(state, contact, com_acceleration=PUSH, orientation=np.array([0.0, 0.0, 0.0, 1.0]))
        vdot_cmd, _ = commanded(state, target, limbs.joints(contact), ordering)
        shared_load(state, PUSH, target.force)
        solution = optimization.solve(state, vdot_cmd, target.force, contact)
        assert solution.solved
        return solution

    return answer


def straight(robot, knee):
    q = robot.standing_configuration()
    q[JOINT_POSITION] = np.tile([0.0, 0.0, knee], 4)
    return Kinematics(robot).at(q, np.zeros(robot.model.nv))


def by_pinocchio(robot, state, solution):
    """q̈ that torques and contact forces cause."""
    effort = np.concatenate([np.zeros(6), solution.torque]) + np.einsum("ikv,ik->v", state.J_contacts, solution.force)
    return pin.aba(robot.model, robot.model.createData(), state.q, state.v, effort)


def by_mujoco(robot, built, state, solution):
    """Accelerations by MuJoCo; the base's acceleration is brought from W to B."""
    model, data = built.model, mujoco.MjData(built.model)
    data.qpos[:] = built.qpos(state.q)
    data.qvel[:3] = state.R_WB @ state.v[BASE_LINEAR]
    data.qvel[3:6] = state.v[BASE_ANGULAR]
    data.qvel[built.joint_dof] = state.v[JOINT_VELOCITY]
    mujoco.mj_fwdPosition(model, data)
    for frame, point, force in zip(robot.contact_frames, state.contact_positions, solution.force, strict=True):
        joint = robot.model.joints[robot.model.frames[frame].parentJoint].idx_v - JOINT_VELOCITY.start
        body = model.dof_bodyid[built.joint_dof[joint]]
        mujoco.mj_applyFT(model, data, force, np.zeros(3), point, body, data.qfrc_applied)
    data.qfrc_applied[built.joint_dof] += solution.torque
    mujoco.mj_forward(model, data)
    linear = state.R_WB.T @ data.qacc[:3] - np.cross(state.v[BASE_ANGULAR], state.v[BASE_LINEAR])
    return np.concatenate([linear, data.qacc[3:6], data.qacc[built.joint_dof]])


def assert_caused(robot, built, state, solution):
    allowed = TOLERANCE * max(1.0, np.abs(solution.vdot).max())
    np.testing.assert_allclose(by_pinocchio(robot, state, solution), solution.vdot, atol=allowed)
    np.testing.assert_allclose(by_mujoco(robot, built, state, solution), solution.vdot, atol=allowed)


@in_contact
@pytest.mark.parametrize("seed", range(5))
def test_torques_cause_the_accelerations(robot, built, state_at, target_at, answer, contact, seed):
    state = state_at(seed)
    assert_caused(robot, built, state, answer(state, target_at, contact))


@in_contact
@pytest.mark.parametrize("knee", STRAIGHT)
def test_torques_of_straight_legs_cause_the_accelerations(robot, built, target_at, answer, contact, knee):
    state = straight(robot, knee)
    assert_caused(robot, built, state, answer(state, target_at, contact))


@pytest.mark.parametrize("seed", range(5))
def test_without_contact_the_momentum_is_nobodys_to_change(state_at, target_at, answer, seed):
    state = state_at(seed)
    solution = answer(state, target_at, CONTACTS["no"])
    rate = state.A_G @ solution.vdot + state.Adot_v_G
    weight = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -9.81 * state.mass])
    np.testing.assert_allclose(rate, weight, atol=TOLERANCE * max(1.0, np.abs(solution.vdot).max()))
