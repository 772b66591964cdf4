import numpy as np
import pinocchio as pin
import pytest

from aerial_model.kinematics import Kinematics, carry
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_LINEAR, BASE_ORIENTATION, BASE_POSITION, GRAVITY, Robot

ROBOT = Robot.load("mini_cheetah")
STEP = 1e-6  # [s] of the central differences
TOLERANCE = 1e-7


@pytest.fixture(params=range(5))
def state(request):
    rng = np.random.default_rng(request.param)
    model = ROBOT.model
    q = pin.integrate(model, ROBOT.standing_configuration(), 0.5 * rng.normal(size=model.nv))
    return q, rng.normal(size=model.nv)


def moved(q, v, dt):
    return pin.integrate(ROBOT.model, q, v * dt)


def rate(value, q, v):
    """Return the time derivative of a quantity along a constant velocity, by central differences."""
    ahead = value(Kinematics(ROBOT).at(moved(q, v, STEP), v))
    behind = value(Kinematics(ROBOT).at(moved(q, v, -STEP), v))
    return (np.array(ahead) - np.array(behind)) / (2 * STEP)


def test_momentum_is_the_momentum_matrix_times_velocity(state):
    here = Kinematics(ROBOT).at(*state)
    h = np.concatenate([here.angular_momentum, ROBOT.mass * here.com_velocity])
    np.testing.assert_allclose(here.A_G @ here.v, h, atol=1e-12)


def test_com_velocity_is_the_rate_of_the_com(state):
    np.testing.assert_allclose(rate(lambda c: c.com, *state), Kinematics(ROBOT).at(*state).com_velocity, atol=TOLERANCE)


def test_momentum_bias_is_the_rate_of_the_momentum_at_constant_velocity(state):
    bias = Kinematics(ROBOT).at(*state).Adot_v_G
    np.testing.assert_allclose(rate(lambda c: c.A_G @ c.v, *state), bias, atol=TOLERANCE)


def test_contact_velocities_are_the_rates_of_the_contact_positions(state):
    velocities = Kinematics(ROBOT).at(*state).contact_velocities
    np.testing.assert_allclose(rate(lambda c: c.contact_positions, *state), velocities, atol=TOLERANCE)


def test_contact_biases_are_the_rates_of_the_contact_velocities_at_constant_velocity(state):
    bias = Kinematics(ROBOT).at(*state).Jdot_v_contacts
    np.testing.assert_allclose(rate(lambda c: c.contact_velocities, *state), bias, atol=TOLERANCE)


def test_link_rates_are_those_of_pinocchio(state):
    q, v = state
    data = ROBOT.model.createData()
    pin.forwardKinematics(ROBOT.model, data, q, v)
    axes = pin.LOCAL_WORLD_ALIGNED
    rates = [pin.getFrameVelocity(ROBOT.model, data, frame, axes).angular for frame in ROBOT.contact_frames]
    np.testing.assert_allclose(Kinematics(ROBOT).at(q, v).omega_contacts, rates, atol=1e-12)


def test_pinocchio_has_the_same_gravity():
    np.testing.assert_array_equal(ROBOT.model.gravity.vector, [0.0, 0.0, -GRAVITY, 0.0, 0.0, 0.0])


def test_a_robot_that_is_carried_is_the_robot_there(state):
    q, v = state
    there = Kinematics(ROBOT).at(q.copy(), v.copy())
    position, velocity = q[BASE_POSITION].copy(), rotation.matrix(q[BASE_ORIENTATION]) @ v[BASE_LINEAR]
    q[BASE_POSITION] = 0.0
    v[BASE_LINEAR] = 0.0
    carried = Kinematics(ROBOT).at(q, v)
    carry(carried, position, velocity)
    for name, value in there._asdict().items():
        np.testing.assert_allclose(getattr(carried, name), value, atol=1e-11, err_msg=name)


def test_a_configuration_is_what_pinocchio_says(state):
    q, v = state
    here = Kinematics(ROBOT).at(q, v)
    model, data = ROBOT.model, ROBOT.model.createData()
    pin.computeAllTerms(model, data, q, v)
    pin.updateFramePlacements(model, data)
    M = np.triu(data.M) + np.triu(data.M, 1).T
    np.testing.assert_allclose(here.M, M, atol=1e-12)
    np.testing.assert_allclose(here.L.T @ here.L, M, atol=1e-12)
    np.testing.assert_array_equal(here.L, np.tril(here.L))
    assert not here.L[9:12, 6:9].any()  # of another leg
    np.testing.assert_allclose(here.nle, data.nle, atol=1e-11)
    np.testing.assert_allclose(here.com, data.com[0], atol=1e-12)
    axes = pin.LOCAL_WORLD_ALIGNED
    for i, frame in enumerate(ROBOT.contact_frames):
        np.testing.assert_allclose(here.J_contacts[i], pin.getFrameJacobian(model, data, frame, axes)[:3], atol=1e-12)
