import numpy as np
import pinocchio as pin
import pytest

from aerial_model.kinematics import Kinematics
from aerial_model.robot import Robot

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
