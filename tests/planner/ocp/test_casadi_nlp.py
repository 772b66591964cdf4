"""The flat program's derivatives against those CasADi makes of the whole problem."""

import casadi as ca
import numpy as np

from aerial_planner.ocp.casadi_nlp import FlatProgram
from aerial_planner.ocp.options import SolverName, SolverOptions
from aerial_planner.ocp.stage import Rows


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
