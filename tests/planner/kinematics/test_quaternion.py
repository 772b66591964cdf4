"""Attitudes as expressions against the same operations on numbers."""

import casadi as ca
import numpy as np
import pytest

from aerial_model.numerics import rotation
from aerial_planner.kinematics import (
    attitude_error,
    conjugate,
    quaternion_product,
    quaternion_step,
    rotation_matrix,
)

TOLERANCE = 1e-12
AXIS = np.array([0.6, -0.64, 0.48])


def numbers(expression):
    return np.asarray(expression).ravel()


@pytest.fixture(params=[0.0, 1e-9, 1e-3, 1.0, 3.0])
def pair(request):
    """Two attitudes a turn of some size apart, near the identity and far from it."""
    rng = np.random.default_rng(3)
    a = rotation.exp(rng.normal(size=3))
    return a, rotation.multiply(a, rotation.exp(request.param * AXIS))


def test_products_and_matrices_are_those_of_numbers(pair):
    a, b = pair
    np.testing.assert_allclose(numbers(quaternion_product(ca.DM(a), ca.DM(b))), rotation.multiply(a, b), atol=TOLERANCE)
    np.testing.assert_allclose(np.asarray(rotation_matrix(ca.DM(b))), rotation.matrix(b), atol=TOLERANCE)


def test_a_quaternion_times_its_conjugate_is_the_identity(pair):
    a = ca.DM(pair[0])
    np.testing.assert_allclose(numbers(quaternion_product(conjugate(a), a)), rotation.IDENTITY, atol=TOLERANCE)


def test_the_error_of_a_small_turn_is_its_rotation_vector():
    turn = 1e-4 * AXIS
    error = attitude_error(ca.DM(rotation.exp(turn)), ca.DM(rotation.IDENTITY))
    np.testing.assert_allclose(numbers(error), turn, atol=TOLERANCE)


@pytest.mark.parametrize("size", [0.0, 1e-6, 0.1, 1.0])
def test_quaternion_step_is_the_exponential(size):
    omega = size * AXIS
    step = numbers(quaternion_step(ca.DM(omega), ca.DM(1.0)))
    np.testing.assert_allclose(step, rotation.exp(omega), atol=1e-10)
