"""Each task against what it says: accelerations integrate to what was asked, errors close, limbs are told apart."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.kinematics import Kinematics
from aerial_model.numerics import rotation
from aerial_model.robot.robot import JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_wbic.gains import ControllerGains, TaskOrder, TaskWeights
from aerial_wbic.target import blank_target
from aerial_wbic.tasks.hierarchy import Task, add_weighted, no_equations, weighted_solution
from aerial_wbic.tasks.limbs import Limbs
from aerial_wbic.tasks.ordering import TaskKind, task_ordering
from aerial_wbic.tasks.tasks import (
    angular_momentum_task,
    attitude_error,
    base_task,
    limb_task,
    momentum_task,
    posture_task,
    task_of,
)

STEP = 1e-5  # of finite differences [s]
DERIVATIVE_TOLERANCE = 1e-3  # [m/s²], [rad/s²], [N·m]
ROUNDING = 1e-8
ACCELERATION_MAX = 1e4  # [rad/s²] for an error of 0.1 m, however straight the leg

ALL = np.ones(4, dtype=bool)
NONE = np.zeros(4, dtype=bool)
ONE = np.array([False, True, False, False])


@pytest.fixture
def limbs(robot):
    return Limbs(robot)


@pytest.fixture
def tasks_of(limbs, gains):
    """The controller's tasks for a target."""

    def tasks_of(state, target):
        ordering = task_ordering(gains)
        joints = limbs.joints(target.contact)
        return tuple(task_of(int(each), state, target, joints, ordering) for each in ordering.order)

    return tasks_of


def after(robot, state, vdot):
    """The robot a moment later, accelerating by ``vdot``."""
    v = state.v + vdot * STEP
    q = pin.integrate(robot.model, state.q, (state.v + v) / 2 * STEP)
    return Kinematics(robot).at(q, v)


@pytest.mark.parametrize("seed", range(5))
def test_loaded_points_do_not_accelerate(robot, limbs, gains, state_at, target_at, seed, prioritized):
    state = state_at(seed)
    task = limb_task(state, target_at(state, ALL), limbs.joints(ALL), gains.swing_joint)
    vdot, _ = prioritized(state.M, (task,))
    later = after(robot, state, vdot)
    change = later.contact_velocities - state.contact_velocities
    np.testing.assert_allclose(change / STEP, 0.0, atol=DERIVATIVE_TOLERANCE)


@pytest.mark.parametrize("seed", range(5))
def test_base_task_accelerates_attitude_and_centre_of_mass_as_asked(robot, state_at, target_at, seed, prioritized):
    state = state_at(seed)
    asked, turned = np.array([1.0, -2.0, 3.0]), np.array([-3.0, 1.0, 2.0])
    task = base_task(state, target_at(state, ALL, com_acceleration=asked, angular_acceleration=turned).body)
    vdot, _ = prioritized(state.M, (task,))
    later = after(robot, state, vdot)
    spin = (later.R_WB @ later.v[3:6] - state.R_WB @ state.v[3:6]) / STEP
    np.testing.assert_allclose((later.com_velocity - state.com_velocity) / STEP, asked, atol=DERIVATIVE_TOLERANCE)
    np.testing.assert_allclose(spin, turned, atol=DERIVATIVE_TOLERANCE)


@pytest.mark.parametrize("seed", range(5))
def test_angular_momentum_changes_at_the_rate_asked_for(robot, gains, state_at, target_at, seed, prioritized):
    state = state_at(seed)
    task = angular_momentum_task(state, target_at(state, ALL), gains.angular_momentum_damping)
    vdot, _ = prioritized(state.M, (task,))
    later = after(robot, state, vdot)
    change = (later.angular_momentum - state.angular_momentum) / STEP
    np.testing.assert_allclose(change, 0.0, atol=DERIVATIVE_TOLERANCE)


@pytest.mark.parametrize("seed", range(5))
def test_feedback_is_that_of_the_reference_velocity(state_at, target_at, gains, seed):
    state = state_at(seed)
    ahead, faster = np.array([0.01, -0.02, 0.03]), np.array([0.1, 0.2, -0.3])
    target = target_at(state, ALL, com=state.com + ahead, com_velocity=state.com_velocity + faster)
    at_target = target_at(state, ALL)
    feedback = base_task(state, target.body).a - base_task(state, at_target.body).a
    position = gains.follow.position
    np.testing.assert_allclose(feedback[3:], position.stiffness * ahead + position.damping * faster, atol=ROUNDING)


def test_attitude_error_turns_the_base_to_where_it_should_be():
    actual = rotation.exp(np.array([0.3, -0.2, 0.5]))
    turn = np.array([0.1, 0.2, -0.1])
    desired = rotation.multiply(rotation.exp(turn), actual)
    np.testing.assert_allclose(attitude_error(desired, actual), turn, atol=ROUNDING)
    np.testing.assert_allclose(attitude_error(-desired, actual), turn, atol=ROUNDING)


def test_a_limb_swings_when_its_point_is_in_the_air(robot, limbs):
    swinging = [robot.joint_names[j] for j in limbs.joints(~ONE).swinging]
    assert swinging == ["fl_abad", "fl_hip", "fl_knee"]
    assert list(limbs.joints(NONE).swinging) == list(range(robot.n_joints))
    assert not len(limbs.joints(ALL).swinging)


@pytest.mark.parametrize("contact", [ALL, ONE, NONE, ~ONE], ids=["four", "one", "no", "three"])
def test_a_robot_on_its_target_keeps_its_velocities(state_at, target_at, tasks_of, contact, prioritized):
    state = state_at(moving=False)
    tasks = tasks_of(state, target_at(state, contact))
    vdot, v_ref = prioritized(state.M, tasks)
    np.testing.assert_allclose(vdot, 0.0, atol=ROUNDING)
    np.testing.assert_allclose(v_ref, 0.0, atol=ROUNDING)


@pytest.mark.parametrize("contact", [ALL, ONE, NONE], ids=["four", "one", "no"])
@pytest.mark.parametrize("seed", range(5))
def test_reference_velocity_keeps_loaded_points_still_and_swings_the_others(
    state_at, target_at, tasks_of, limbs, contact, seed, prioritized
):
    state = state_at(seed)
    target = target_at(state, contact)
    _, v_ref = prioritized(state.M, tasks_of(state, target))
    swinging = limbs.joints(contact).swinging
    np.testing.assert_allclose(state.J_contacts[contact] @ v_ref, 0.0, atol=ROUNDING)
    np.testing.assert_allclose(v_ref[JOINT_VELOCITY][swinging], target.joint_velocity[swinging], atol=ROUNDING)


@pytest.mark.parametrize("knee", [0.0, 1e-6, 1e-3, 0.03, 0.1])
def test_straight_legs_do_not_blow_up(robot, target_at, tasks_of, knee, prioritized):
    q = robot.standing_configuration()
    q[JOINT_POSITION] = np.tile([0.0, 0.0, knee], 4)
    state = Kinematics(robot).at(q, np.zeros(robot.model.nv))
    sunk = target_at(state, ALL, com=state.com - [0.0, 0.0, 0.1])
    vdot, _ = prioritized(state.M, tasks_of(state, sunk))
    np.testing.assert_allclose(state.J_contacts @ vdot, 0.0, atol=ROUNDING)
    assert np.abs(vdot).max() < ACCELERATION_MAX


# --- the orderings ---------------------------------------------------------------------------------------------------


def ordered(gains, order):
    return task_ordering(dataclasses.replace(gains, tasks=order))


@pytest.mark.parametrize("contact", [ALL, ONE, NONE, ~ONE], ids=["four", "one", "no", "three"])
@pytest.mark.parametrize("order", TaskOrder)
def test_in_any_ordering_a_robot_on_its_target_stays_there(
    state_at, target_at, limbs, gains, order, contact, commanded
):
    state = state_at(moving=False)
    vdot, v_ref = commanded(state, target_at(state, contact), limbs.joints(contact), ordered(gains, order))
    np.testing.assert_allclose(vdot, 0.0, atol=ROUNDING)
    np.testing.assert_allclose(v_ref, 0.0, atol=ROUNDING)


@pytest.mark.parametrize("order", [TaskOrder.WBC_A, TaskOrder.WBC_B, TaskOrder.WBC_C])
@pytest.mark.parametrize("contact", [ALL, ONE, NONE, ~ONE], ids=["four", "one", "no", "three"])
def test_strict_orderings_never_give_up_the_limbs(state_at, target_at, limbs, gains, order, contact, commanded):
    state = state_at(3)
    target = target_at(state, contact, com_acceleration=np.array([5.0, -5.0, 20.0]), com=state.com + 0.05)
    joints, ordering = limbs.joints(contact), ordered(gains, order)
    first = limb_task(state, target, joints, gains.swing_joint)
    vdot, _ = commanded(state, target, joints, ordering)
    np.testing.assert_allclose(first.J @ vdot, first.a, atol=ROUNDING * max(1.0, np.abs(vdot).max()))


@pytest.mark.parametrize("seed", range(5))
def test_momentum_task_says_what_the_centre_of_mass_and_the_angular_momentum_tasks_say(
    state_at, target_at, gains, seed
):
    state = state_at(seed)
    target = target_at(state, ALL, com=state.com + 0.02, orientation=rotation.exp(np.array([0.2, 0.0, 0.0])))
    momentum = momentum_task(state, target, gains.angular_momentum_damping)
    angular = angular_momentum_task(state, target, gains.angular_momentum_damping)
    base = base_task(state, target.body)
    for whole, upper, lower in zip(momentum, angular, base, strict=True):
        np.testing.assert_array_equal(whole[:3], upper)
        np.testing.assert_array_equal(whole[3:], lower[3:])


def test_without_arms_a_posture_is_asked_of_what_does_not_swing(robot, state_at, target_at, limbs, gains):
    posed = limbs.joints(ONE).posed
    assert [robot.joint_names[j] for j in posed] == ["fl_abad", "fl_hip", "fl_knee"]
    state = state_at(1)
    task = posture_task(state, target_at(state, ONE), posed, gains.swing_joint)
    np.testing.assert_array_equal(task.J @ state.v, state.v[JOINT_VELOCITY][posed])
    np.testing.assert_allclose(task.a, 0.0, atol=ROUNDING)


def test_every_weighted_task_has_its_own_weight(gains):
    weights = TaskWeights(limbs=1.0, base=2.0, spare_joints=3.0, angular_momentum=4.0)
    said = task_ordering(dataclasses.replace(gains, tasks=TaskOrder.WEIGHTED, task_weights=weights))
    expected = {TaskKind.LIMBS: 1.0, TaskKind.BASE: 2.0, TaskKind.SPARE_JOINTS: 3.0, TaskKind.ANGULAR_MOMENTUM: 4.0}
    assert dict(zip(said.order.astype(int), said.weights, strict=True)) == expected
    assert not len(task_ordering(gains).weights)


def test_weighted_tasks_share_what_they_disagree_on():
    J = np.array([[1.0, 0.0]])
    tasks = (Task(J, np.array([0.0]), np.array([3.0])), Task(J, np.array([4.0]), np.array([3.0])))
    equations, (vdot, v_ref) = no_equations(1e-6 * np.eye(2)), np.empty((2, 2))
    for task, weight in zip(tasks, (1.0, 3.0), strict=True):
        add_weighted(equations, task, weight)
    weighted_solution(equations, vdot, v_ref)
    np.testing.assert_allclose(vdot, [3.0, 0.0], atol=ROUNDING)
    np.testing.assert_allclose(v_ref, [3.0, 0.0], atol=ROUNDING)


@pytest.mark.parametrize("mask", [(1, 1, 1, 1), (1, 0, 1, 0), (1, 1, 0, 1)])
def test_feet_with_several_points_are_held_without_saying_it_twice(mask):
    robot = Robot.load("mit_humanoid")
    gains = robot.section("controller", ControllerGains)
    q = robot.standing_configuration()
    state = Kinematics(robot).at(q, np.random.default_rng(0).normal(0, 0.3, robot.model.nv))
    contact = np.array(mask, dtype=bool)
    target = blank_target(robot.n_joints, robot.n_contacts, gains.hold)
    target.contact[:] = contact
    joints = Limbs(robot).joints(contact)
    task = limb_task(state, target, joints, gains.swing_joint)
    assert len(task.a) == len(robot.holding_rows(contact)) + len(joints.swinging)
    assert np.linalg.matrix_rank(task.J) == len(task.a)


def test_in_the_air_nothing_asks_for_another_angular_momentum(robot, gains, state_at, target_at):
    state = state_at(3)
    target = target_at(state, NONE)
    target.angular_momentum[:] += 1.0
    task = angular_momentum_task(state, target, gains.angular_momentum_damping)
    vdot = np.linalg.lstsq(task.J, task.a, rcond=None)[0]
    np.testing.assert_allclose(state.A_G[:3] @ vdot + state.Adot_v_G[:3], 0.0, atol=1e-9)
