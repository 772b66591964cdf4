"""Torques against Pinocchio's forward dynamics, friction, and the count of what motors cannot give."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.kinematics import Kinematics
from aerial_model.robot.robot import JOINT_VELOCITY, Robot
from aerial_model.values.measurement import Measurement
from aerial_wbic.force_qp.optimization import ForceOptimization
from aerial_wbic.gains import ControllerGains
from aerial_wbic.joint_command import JointCommands
from aerial_wbic.target import PostureTarget

ACCELERATION_TOLERANCE = 1e-6  # [m/s²], [rad/s²]


@pytest.fixture
def joint_commands(robot, gains):
    return JointCommands(robot, gains)


def measured(state):
    return Measurement(
        time=1.5,
        sequence=7,
        orientation=state.base_orientation,
        angular_velocity=state.v[3:6],
        linear_acceleration=np.zeros(3),
        joint_position=state.q[7:],
        joint_velocity=state.v[6:],
        joint_torque=np.zeros(len(state.v) - 6),
    )


@pytest.mark.parametrize("contact", [[1, 1, 1, 1], [0, 1, 0, 0], [0, 0, 0, 0]], ids=["four", "one", "no"])
@pytest.mark.parametrize("seed", range(5))
def test_torque_reproduces_the_acceleration(robot, gains, state_at, contact, seed):
    state, random = state_at(seed), np.random.default_rng(seed)
    optimization = ForceOptimization(robot, gains.weight_base, gains.weight_force)
    f_cmd = random.normal([0, 0, 30.0], 5.0, (4, 3))
    solution = optimization.solve(state, 5 * random.normal(size=len(state.v)), f_cmd, np.array(contact, dtype=bool))
    torque = np.concatenate([np.zeros(6), solution.torque])
    torque += np.einsum("ikv,ik->v", state.J_contacts, solution.force)
    vdot = pin.aba(robot.model, robot.model.createData(), state.q, state.v, torque)
    np.testing.assert_allclose(vdot, solution.vdot, atol=ACCELERATION_TOLERANCE)


def test_friction_of_the_reference_velocity_is_fed_forward(robot, gains, joint_commands, state_at):
    state = state_at(0)
    torque, v_ref = np.random.default_rng(0).normal(size=robot.n_joints), np.zeros(robot.model.nv)
    still = joint_commands.command(torque, v_ref, measured(state))
    v_ref[JOINT_VELOCITY] = 10 * gains.stiction_speed
    np.testing.assert_array_equal(still.torque, torque)
    moving = joint_commands.command(torque, v_ref, measured(state))
    expected = robot.actuators.dry_friction + robot.actuators.damping * 10 * gains.stiction_speed
    np.testing.assert_allclose(moving.torque - still.torque, expected, rtol=1e-6)
    np.testing.assert_array_equal(moving.velocity, v_ref[JOINT_VELOCITY])


def test_a_command_names_the_measurement_it_answers(joint_commands, state_at):
    state = state_at(moving=False)
    command = joint_commands.command(np.zeros(12), np.zeros(18), measured(state))
    assert (command.state_time, command.state_sequence) == (1.5, 7)


@pytest.mark.parametrize(("share", "saturated"), [(0.99, 0), (1.01, 1)])
def test_ticks_beyond_a_limit_are_counted_and_asked_for_all_the_same(robot, joint_commands, state_at, share, saturated):
    state, torque = state_at(moving=False), share * robot.actuators.torque_max
    command = joint_commands.command(torque, np.zeros(len(state.v)), measured(state))
    np.testing.assert_array_equal(command.torque, torque)
    assert joint_commands.saturated_ticks == saturated


def test_a_voltage_beyond_the_bus_counts_too(robot, joint_commands, state_at):
    state = state_at(moving=False)
    state.v[JOINT_VELOCITY] = 0.99 * robot.actuators.no_load_speed
    joint_commands.command(np.zeros(robot.n_joints), 2 * state.v, measured(state))
    assert joint_commands.saturated_ticks == 1


@pytest.mark.parametrize("seed", range(5))
def test_torques_at_the_end_of_their_room_ask_for_the_share_of_the_limits(robot, gains, joint_commands, state_at, seed):
    state, v_ref = state_at(seed), np.random.default_rng(seed).normal(0, 5, robot.model.nv)
    measurement, law = measured(state), robot.actuators
    along = gains.joint_damping * (v_ref - state.v)[JOINT_VELOCITY]
    along += law.friction(v_ref[JOINT_VELOCITY], gains.stiction_speed)
    for torque, beyond in zip(joint_commands.headroom(v_ref, measurement), (-0.01, 0.01), strict=True):
        assert not joint_commands.exceeds(torque - beyond, v_ref, measurement)
        assert joint_commands.exceeds(torque + beyond, v_ref, measurement)
        requested = torque + along
        use = np.maximum(law.torque_ratio(requested), law.voltage_ratio(requested, measurement.joint_velocity))
        np.testing.assert_allclose(use, gains.actuator_share)


def test_a_joint_that_moves_little_is_led_more_softly(robot, gains):
    """Else boards that sample would shake it: damping must not stop it within one of their periods."""
    state = Kinematics(robot).at(robot.standing_configuration(), np.zeros(robot.model.nv))
    inertia = 1.0 / np.diag(np.linalg.inv(state.M))[JOINT_VELOCITY]
    for factor in (1.0, 100.0):
        stiff = dataclasses.replace(gains, joint_damping=factor * gains.joint_damping)
        damping = JointCommands(robot, stiff).command(np.zeros(12), np.zeros(18), measured(state)).damping
        np.testing.assert_allclose(damping, np.minimum(stiff.joint_damping, 500.0 * inertia))


def test_arms_beyond_their_room_are_clipped_and_do_not_count():
    """No force on the feet would help them."""
    robot = Robot.load("mit_humanoid")
    joint_commands = JointCommands(robot, robot.section("controller", ControllerGains))
    state = Kinematics(robot).at(robot.standing_configuration(), np.zeros(robot.model.nv))
    torque, v_ref = np.zeros(robot.n_joints), np.zeros(robot.model.nv)
    torque[robot.arms] = 2 * robot.actuators.torque_max[robot.arms]
    assert not joint_commands.exceeds(torque, v_ref, measured(state))
    asked = joint_commands.command(torque, v_ref, measured(state)).torque
    assert np.all(asked[robot.arms] <= robot.actuators.torque_max[robot.arms])
    torque[0] = 2 * robot.actuators.torque_max[0]
    assert joint_commands.exceeds(torque, v_ref, measured(state))


def test_a_stopped_robot_only_resists_motion(gains, joint_commands, state_at):
    command = joint_commands.resting(None, measured(state_at(0)))
    assert not command.torque.any()
    assert not command.stiffness.any()
    assert not command.velocity.any()
    assert np.all(command.damping == gains.stop_damping)


def test_a_posture_is_left_to_the_boards(gains, joint_commands, robot, state_at):
    posture = PostureTarget(joint_position=robot.poses["tuck"], joint_velocity=np.ones(robot.n_joints))
    command = joint_commands.resting(posture, measured(state_at(0)))
    np.testing.assert_array_equal(command.position, robot.poses["tuck"])
    assert np.all(command.stiffness == gains.posture_stiffness)


def test_a_command_is_always_finite(gains, joint_commands, state_at):
    state = state_at(moving=False)
    torque = np.array([np.nan, *np.ones(11)])
    command = joint_commands.command(torque, np.zeros(len(state.v)), measured(state))
    assert not command.torque.any()
    assert np.all(command.damping == gains.stop_damping)


def test_no_joint_is_led_into_its_stop(robot, gains, joint_commands, state_at):
    """A reference that goes on where the joint cannot asks the motor for torque in vain."""
    state = state_at(0)
    lower, upper = robot.model.lowerPositionLimit[7:], robot.model.upperPositionLimit[7:]
    for position, allowed in ((lower, [0.0, 9.0]), (upper, [-9.0, 0.0]), (0.5 * (lower + upper), [-9.0, 9.0])):
        v_ref, torque = np.zeros(robot.model.nv), np.zeros(robot.n_joints)
        measurement = dataclasses.replace(measured(state), joint_position=position)
        for wanted, expected in zip((-9.0, 9.0), allowed, strict=True):
            v_ref[JOINT_VELOCITY] = wanted
            np.testing.assert_array_equal(
                joint_commands.command(torque, v_ref, measurement).velocity, np.full(12, expected)
            )
