"""A stage kind's functions against finite differences, and the chain rule against what it abbreviates."""

import dataclasses

import casadi as ca
import numpy as np
import pytest

from aerial_planner.ocp.stage import Rows


@pytest.fixture
def kind():
    x, u, p, y = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p"), ca.SX.sym("y", 2)
    rows = Rows()
    rows.between("limit", ca.vertcat(y[0] ** 3 * u, ca.cos(y[1]) * x[1] + y[0]), -1.0, 2.0)
    rows.equal("start", x[0] - 1.0)
    y_is = ca.vertcat(x[0] * u + p, ca.sin(x[1]) * x[0])
    return rows.stage("stage", x, u, p, y[0] ** 2 * y[1] + u**2, ca.vertcat(x[1] * u, x[0]), y=y, y_is=y_is)


def central_difference(function, z):
    """Return the derivative of a vector function at z."""
    h = 1e-6
    columns = [(function(z + step) - function(z - step)) / (2 * h) for step in h * np.eye(len(z))]
    return np.column_stack(columns)


def test_derivatives_are_those_of_finite_differences(kind):
    values, derivatives = kind.batch_functions()
    rng = np.random.default_rng(0)
    z, p, lam_x, lam_g = (rng.normal(size=n) for n in (3, 1, 2, 3))

    def value(i):
        return lambda z: values(z, p)[i].full().ravel()

    def lagrangian(z):
        cost, following, g = (part.full().ravel() for part in values(z, p))
        return cost - lam_x @ following + lam_g @ g

    gradient, F, G, slope, H = (part.full() for part in derivatives(z, p, lam_x, lam_g))
    np.testing.assert_allclose(gradient.T, central_difference(value(0), z), atol=1e-8)
    np.testing.assert_allclose(-F, central_difference(value(1), z), atol=1e-8)
    np.testing.assert_allclose(G, central_difference(value(2), z), atol=1e-8)
    np.testing.assert_allclose(slope.T, central_difference(lagrangian, z), atol=1e-8)

    def gradient_of_lagrangian(z):
        return derivatives(z, p, lam_x, lam_g)[3].full().ravel()

    np.testing.assert_allclose(H, central_difference(gradient_of_lagrangian, z), atol=1e-7)


def test_rows_keep_their_order_bounds_and_labels(kind):
    np.testing.assert_array_equal(kind.lower, [-1.0, -1.0, 0.0])
    np.testing.assert_array_equal(kind.upper, [2.0, 2.0, 0.0])
    assert kind.labels == ("limit", "limit", "start")


def test_derivatives_through_intermediate_quantities_are_those_without():
    x, u, p, y = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p"), ca.SX.sym("y", 2)
    y_is = ca.vertcat(x[0] * u + p, ca.sin(x[1]) * x[0])
    rows = Rows()
    rows.between("limit", ca.vertcat(y[0] ** 3 * u, ca.cos(y[1]) * x[1] + y[0]), -1.0, 1.0)
    short = rows.stage("short", x, u, p, y[0] ** 2 * y[1] + u**2, ca.vertcat(x[1] * u, x[0]), y=y, y_is=y_is)
    in_full = [ca.substitute(expression, y, y_is) for expression in (short.cost, short.constraints)]
    nothing = ca.SX(0, 1)
    long = dataclasses.replace(short, cost=in_full[0], constraints=in_full[1], y=nothing, y_is=nothing)
    rng = np.random.default_rng(0)
    functions = [[*kind.batch_functions(), *vars(kind.nlp_functions()).values()] for kind in (short, long)]
    for ours, theirs in zip(*functions, strict=True):
        arguments = [rng.normal(size=theirs.size_in(i)) for i in range(theirs.n_in())]
        for a, b in zip(ours.call(arguments), theirs.call(arguments), strict=True):
            np.testing.assert_allclose(ca.DM(a).full(), ca.DM(b).full(), atol=1e-12)


def test_the_next_state_must_not_depend_on_intermediate_quantities():
    x, u, y = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("y")
    with pytest.raises(ValueError, match="next_state must not depend on y"):
        Rows().stage("stage", x, u, ca.SX(0, 1), u**2, x + y, y=y, y_is=x * u)


def test_intermediate_quantities_must_not_depend_on_themselves():
    x, u, y = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("y")
    with pytest.raises(ValueError, match="y_is must not depend on y"):
        Rows().stage("stage", x, u, ca.SX(0, 1), u**2, x, y=y, y_is=x * y)
