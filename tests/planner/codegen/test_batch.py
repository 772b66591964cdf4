"""Batch evaluation against calls of the function one point at a time."""

import casadi as ca
import numpy as np
import pytest

from aerial_planner.codegen.batch import Batch, Interpreted, no_machine_code


@pytest.fixture
def function():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y", 3)
    return ca.Function("f", [x, y], [ca.jacobian(x[0] * y, ca.vertcat(x, y)), ca.sin(x[1]) + ca.sumsqr(y)])


def test_a_batch_is_the_function_at_each_point(function):
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(4, 2)), rng.normal(size=(4, 3))
    matrices, scalars = Batch(function, no_machine_code)(x, y)
    for k in range(4):
        matrix, scalar = function(x[k], y[k])
        np.testing.assert_array_equal(matrices[k], matrix.full().ravel(order="F"))
        np.testing.assert_array_equal(scalars[k], scalar.full().ravel())


def test_results_are_copies_that_the_next_call_leaves_alone(function):
    batch = Batch(function, no_machine_code)
    _, first = batch(np.zeros((1, 2)), np.ones((1, 3)))
    batch(np.ones((1, 2)), np.zeros((1, 3)))
    np.testing.assert_array_equal(first, [[3.0]])


def test_memory_of_a_number_of_points_is_made_once(function):
    batch = Batch(function, no_machine_code)
    assert batch.memory(3) is batch.memory(3)
    assert batch.memory(3) is not batch.memory(2)


def test_machine_code_is_looked_for_once_until_it_is_renewed(function):
    asked = []
    batch = Batch(function, asked.append)
    batch.memory(1)
    batch.memory(2)
    assert len(asked) == 1
    batch.renew()
    batch.memory(1)
    assert len(asked) == 2


def test_nonzeros_come_in_the_order_they_are_written(function):
    interpreted = Interpreted(function)
    nonzeros, scalar = np.empty(len(interpreted.nonzeros(0))), np.empty(1)
    interpreted.bind(1, [np.array([2.0, 0.0]), np.array([3.0, 4.0, 5.0])], [nonzeros, scalar])()
    matrix = np.zeros((3, 5))
    matrix[tuple(interpreted.nonzeros(0).T)] = nonzeros
    np.testing.assert_array_equal(matrix, function([2.0, 0.0], [3.0, 4.0, 5.0])[0].full())
