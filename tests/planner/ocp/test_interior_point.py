"""The interior-point method on problems whose optima are known, and against IPOPT."""

import casadi as ca
import numpy as np
import pytest

from aerial_planner.ocp.options import SolverName, SolverOptions
from aerial_planner.ocp.problem import Problem
from aerial_planner.ocp.stage import Rows, StageData

NONE = ca.SX(0, 1)


def solved(rows, x, cost, guess, low=-np.inf, high=np.inf, **options):
    """Return the solution of a problem of a single stage."""
    n = x.numel()
    kind = rows.stage("only", x, NONE, NONE, cost, None)
    data = StageData.free(
        p=np.zeros(0), x=np.array(guess), x_min=np.broadcast_to(low, n) * 1.0, x_max=np.broadcast_to(high, n) * 1.0
    )
    return Problem([kind], SolverOptions(**{"tolerance": 1e-7, **options})).solve([data])


def test_problem_71_of_hock_and_schittkowski():
    x, rows = ca.SX.sym("x", 4), Rows()
    rows.between("product", x[0] * x[1] * x[2] * x[3], 25.0, np.inf)
    rows.between("sphere", ca.sumsqr(x), 40.0, 40.0)
    solution = solved(rows, x, x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2], [1.0, 5.0, 5.0, 1.0], 1.0, 5.0)
    assert solution.converged
    np.testing.assert_allclose(solution.x[0], [1.0, 4.7429994, 3.8211503, 1.3794082], atol=1e-5)
    assert solution.binding == ("product",)


def test_a_curved_valley():
    x = ca.SX.sym("x", 2)
    solution = solved(Rows(), x, 100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2, [-1.2, 1.0])
    assert solution.converged
    np.testing.assert_allclose(solution.x[0], [1.0, 1.0], atol=1e-5)


def test_from_a_maximum_it_finds_a_minimum():
    """At the guess the gradient along the circle is zero and the curvature negative."""
    x, rows = ca.SX.sym("x", 2), Rows()
    rows.equal("circle", ca.sumsqr(x) - 1.0)
    solution = solved(rows, x, x[0] + 0.1 * x[1], [0.99, 0.15])
    assert solution.converged
    np.testing.assert_allclose(solution.x[0], np.array([-1.0, -0.1]) / np.hypot(1.0, 0.1), atol=1e-5)


def test_a_fixed_variable_stays_where_it_is_told():
    x, rows = ca.SX.sym("x", 3), Rows()
    rows.equal("sum", ca.sum1(x) - 3.0)
    fixed = np.array([-np.inf, 0.5, -np.inf]), np.array([np.inf, 0.5, np.inf])
    solution = solved(rows, x, ca.sumsqr(x), [0.0, 0.0, 0.0], *fixed)
    assert solution.converged
    np.testing.assert_allclose(solution.x[0], [1.25, 0.5, 1.25], atol=1e-6)


def test_it_gives_up_after_as_many_iterations_as_allowed():
    x = ca.SX.sym("x", 2)
    solution = solved(Rows(), x, 100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2, [-1.2, 1.0], max_iterations=3)
    assert not solution.converged
    assert solution.iterations == 3


def test_what_is_not_finite_is_not_called_solved():
    x = ca.SX.sym("x", 1)
    solution = solved(Rows(), x, ca.sqrt(x - 2.0), [1.0])
    assert not solution.converged


def pendulum(solver):
    """Return the solution of a swing-up with a weak motor: many stages, saturated controls, a full turn."""
    dt, n = 0.1, 100
    x, u, x_0 = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("x_0", 2)
    rate = x[1] + dt * (u - ca.sin(x[0]))
    step = ca.vertcat(x[0] + dt * rate, rate)
    first, end = Rows(), Rows()
    first.equal("start", x - x_0)
    end.equal("goal", x - ca.DM([np.pi, 0.0]))
    middle = Rows().stage("middle", x, u, NONE, 0.1 * u**2 + 0.01 * ca.sumsqr(x), step)
    kinds = [first.stage("first", x, u, x_0, u**2, step), *[middle] * (n - 1), end.stage("end", x, NONE, NONE, 0, None)]
    most = np.array([0.7])
    guess = [np.array([np.pi * k / n, 0.0]) for k in range(n + 1)]
    data = [
        StageData.free(p=np.zeros(2 if k == 0 else 0), x=guess[k], u=np.zeros(1), u_min=-most, u_max=most)
        for k in range(n)
    ]
    data.append(StageData.free(p=np.zeros(0), x=guess[n]))
    return Problem(kinds, SolverOptions(solver=solver, tolerance=1e-7, max_iterations=200)).solve(data)


@pytest.mark.parametrize("solver", [SolverName.FATROP, SolverName.IPOPT])
def test_a_pendulum_swings_up_as_others_have_it(solver):
    ours, theirs = pendulum(SolverName.RICCATI), pendulum(solver)
    assert ours.converged
    assert theirs.converged
    assert ours.max_violation < 1e-6
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-4)
