"""Problems against closed forms, and the solvers against each other."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from aerial_planner.ocp.options import SolverName, SolverOptions
from aerial_planner.ocp.problem import Problem
from aerial_planner.ocp.stage import Rows, StageData

DT, N = 0.1, 60
A = np.array([[1.0, DT], [0.0, 1.0]])
B = np.array([[0.5 * DT**2], [DT]])


def double_integrator(solver):
    x, u, x_0 = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("x_0", 2)
    cost = ca.sumsqr(x) + u**2
    following = ca.DM(A) @ x + ca.DM(B) @ u
    first, end = Rows(), Rows()
    first.equal("start", x - x_0)
    kinds = [first.stage("first", x, u, x_0, cost, following)]
    kinds += [Rows().stage("middle", x, u, ca.SX(0, 1), cost, following)] * (N - 1)
    kinds.append(end.stage("end", x, ca.SX(0, 1), ca.SX(0, 1), ca.sumsqr(x), None))
    # Rows().stage makes a new kind each time it is called; the middle one above is shared on purpose.
    return Problem(kinds, SolverOptions(solver=solver, tolerance=1e-8))


def stages(x_0, u_max=np.inf):
    middle = StageData.free(
        p=np.zeros(0), x=np.zeros(2), u=np.zeros(1), u_min=-u_max * np.ones(1), u_max=u_max * np.ones(1)
    )
    first = StageData.free(p=x_0, x=x_0, u=np.zeros(1), u_min=-u_max * np.ones(1), u_max=u_max * np.ones(1))
    return [first, *[middle] * (N - 1), StageData.free(p=np.zeros(0), x=np.zeros(2))]


@pytest.mark.parametrize("solver", list(SolverName))
def test_an_unconstrained_linear_problem_has_the_riccati_solution(solver):
    x_0 = np.array([1.0, -0.5])
    P = solve_discrete_are(A, B, np.eye(2), np.eye(1))
    gain = np.linalg.solve(np.eye(1) + B.T @ P @ B, B.T @ P @ A)
    solution = double_integrator(solver).solve(stages(x_0))
    assert solution.converged
    np.testing.assert_allclose(solution.u[0], -gain @ x_0, atol=1e-3)


@pytest.mark.parametrize("solver", list(SolverName))
def test_bounds_are_kept_and_reached(solver):
    solution = double_integrator(solver).solve(stages(np.array([1.0, -0.5]), u_max=0.2))
    u = np.array(solution.u[:-1])
    assert solution.max_violation < 1e-6
    assert np.abs(u).max() == pytest.approx(0.2, abs=1e-4)


@pytest.mark.parametrize("solver", list(SolverName))
def test_an_impossible_problem_is_not_called_solved(solver):
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    first, end = Rows(), Rows()
    first.equal("start", x)
    end.equal("goal", x - 10.0)
    kinds = [
        first.stage("first", x, u, ca.SX(0, 1), u**2, x + u),
        end.stage("end", x, ca.SX(0, 1), ca.SX(0, 1), ca.SX(0), None),
    ]
    one = np.ones(1)
    data = [
        StageData.free(p=np.zeros(0), x=0 * one, u=0 * one, u_min=-one, u_max=one),
        StageData.free(p=np.zeros(0), x=0 * one),
    ]
    solution = Problem(kinds, SolverOptions(solver=solver)).solve(data)
    assert not solution.converged
    assert solution.max_violation > 1.0


def test_stages_that_do_not_fit_are_refused():
    x, y = ca.SX.sym("x"), ca.SX.sym("y", 2)
    none = ca.SX(0, 1)
    kinds = [Rows().stage("a", x, none, none, ca.SX(0), x), Rows().stage("b", y, none, none, ca.SX(0), None)]
    with pytest.raises(ValueError, match="stage a leads to 1 states, b has 2"):
        Problem(kinds, SolverOptions())


def test_bounds_hold_the_optimum_back_where_the_solution_says_so():
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    first, end = Rows(), Rows()
    first.between("effort", u, -1.0, 1.0)
    end.between("goal", x, 0.0, 5.0)
    none = ca.SX(0, 1)
    kinds = [
        first.stage("first", x, u, none, 0.1 * u**2, x + u),
        end.stage("end", x, none, none, (x - 3.0) ** 2, None),
    ]
    zero = np.zeros(1)
    problem = Problem(kinds, SolverOptions(tolerance=1e-7))
    data = [StageData.free(p=zero[:0], x=zero, u=zero, x_min=zero, x_max=zero), StageData.free(p=zero[:0], x=zero)]
    solution = problem.solve(data)
    assert solution.binding == ("effort",)
    np.testing.assert_allclose(solution.u[0], [1.0], atol=1e-5)


def test_the_violation_of_a_guess_is_its_largest_miss():
    guess = stages(np.array([1.0, -0.5]))
    guess[3] = StageData.free(p=np.zeros(0), x=np.array([0.0, 0.7]), u=np.zeros(1))
    assert double_integrator(SolverName.RICCATI).violation(guess) == pytest.approx(
        max(np.abs(A @ [1.0, -0.5]).max(), 0.7)
    )


def test_stage_data_that_names_no_bounds_has_none():
    data = StageData.free(p=np.zeros(0), x=np.zeros(2))
    assert np.all(data.x_min == -np.inf)
    assert np.all(data.x_max == np.inf)
    assert data.u.size == data.u_min.size == data.u_max.size == 0
