"""The stage-wise problem against a closed form, against CasADi's own derivatives, and the solvers against each other."""

import dataclasses

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from aerial_planner.ocp.casadi_nlp import FlatProgram
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


def test_stage_wise_derivatives_are_those_of_the_whole_problem():
    """Two kinds with non-linear expressions, states and parameters of different sizes."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p")
    y = ca.SX.sym("y", 3)
    first, end = Rows(), Rows()
    first.between("a", ca.sin(x[0]) * u * p, -1.0, 1.0)
    end.between("b", y[0] * y[1] * y[2], -1.0, 1.0)
    one = first.stage("one", x, u, p, ca.exp(x[1]) * u**2, ca.vertcat(x[0] * u, ca.cos(x[1]), p * u))
    two = end.stage("two", y, ca.SX(0, 1), ca.SX(0, 1), ca.sumsqr(y) ** 2, None)
    functions = FlatProgram([one, two], SolverOptions(solver=SolverName.FATROP)).functions

    w, lam_g, lam_f = ca.MX.sym("w", 6), ca.MX.sym("l", 5), ca.MX.sym("lf")
    f, g = functions["nlp_f"](w, 0.7), functions["nlp_g"](w, 0.7)
    H, gradient = ca.hessian(lam_f * f + ca.dot(lam_g, g), w)
    oracle = ca.Function("oracle", [w, lam_f, lam_g], [ca.jacobian(g, w), gradient, H])
    rng = np.random.default_rng(0)
    point, multipliers = rng.normal(size=6), rng.normal(size=5)
    J_oracle, gradient_oracle, H_oracle = oracle(point, 1.3, multipliers)
    _, J = functions["nlp_jac_g"](point, 0.7)
    gradient, H = functions["nlp_hess_l"](point, 0.7, 1.3, multipliers)
    for ours, theirs in ((J, J_oracle), (gradient, gradient_oracle), (H, H_oracle)):
        np.testing.assert_allclose(ca.DM(ours).full(), ca.DM(theirs).full(), atol=1e-12)


def test_stages_that_do_not_fit_are_refused():
    x, y = ca.SX.sym("x"), ca.SX.sym("y", 2)
    none = ca.SX(0, 1)
    kinds = [Rows().stage("a", x, none, none, ca.SX(0), x), Rows().stage("b", y, none, none, ca.SX(0), None)]
    with pytest.raises(ValueError, match="stage a leads to 1 states, b has 2"):
        Problem(kinds, SolverOptions())


def test_derivatives_through_a_shorthand_are_those_without():
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


def test_what_a_stage_leads_to_cannot_be_said_in_shorthand():
    x, u, y = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("y")
    with pytest.raises(ValueError, match="next_state must not depend on y"):
        Rows().stage("stage", x, u, ca.SX(0, 1), u**2, x + y, y=y, y_is=x * u)
