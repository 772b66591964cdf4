"""The stage-wise Newton step against the dense optimality conditions of the whole problem."""

import casadi as ca
import numpy as np
import pytest

from aerial_planner.ocp.newton import NewtonSystem, Terms
from aerial_planner.ocp.sequence import StageSequence
from aerial_planner.ocp.stage import Rows, StageKind

NONE = ca.SX(0, 1)
FIXED = np.array([0, 5])  # a state of the first stage, a control of the second


def kinds():
    """Three stages of different sizes, with inequalities of few and of many entries, and equalities."""
    x, u, v, y = (ca.SX.sym(name, n) for name, n in (("x", 2), ("u", 1), ("v", 2), ("y", 3)))
    first, middle, end = Rows(), Rows(), Rows()
    first.between("few", ca.vertcat(ca.sin(x[0]) * u, x[1] ** 2), -1.0, 1.0)
    middle.equal("equal", x[0] * v[1] - 0.1)
    for i in range(8):
        middle.between("some", ca.cos(x[i % 2]) * v[0] + i * x[1] * v[1], -2.0, 2.0)
    end.between("end", ca.sumsqr(y), -np.inf, 3.0)
    return [
        first.stage("first", x, u, NONE, ca.exp(x[1]) * u**2, ca.vertcat(x[0] * u, x[1] - u)),
        middle.stage(
            "middle", x, v, NONE, ca.sumsqr(v) + x[0] ** 4, ca.vertcat(ca.sin(x[0]) + v[0], x[1], v[1] * v[0])
        ),
        end.stage("end", y, NONE, NONE, 2.0 * ca.sumsqr(y) + y[0] * y[1], None),
    ]


def many_entries():
    """One stage with an inequality of ten entries, more than are squared one by one, and one of two."""
    x, rows = ca.SX.sym("x", 10), Rows()
    rows.between("many", ca.sumsqr(x) + ca.sum1(x), -np.inf, 3.0)
    rows.between("few", x[2] * x[7], -1.0, 1.0)
    rows.equal("equal", ca.sum1(ca.sin(x)))
    return [rows.stage("only", x, NONE, NONE, ca.sumsqr(x) + x[0] * x[1] * x[2], None)]


class Whole:
    """All stages as one problem, differentiated by CasADi as a whole."""

    def __init__(self, kinds):
        w = ca.SX.sym("w", sum(kind.z.numel() for kind in kinds))
        at, following, cost, self.miss, g = 0, None, 0, [], []
        for kind in kinds:
            z = w[at : at + kind.z.numel()]
            at += kind.z.numel()
            outputs = [kind.cost, kind.constraints, NONE if kind.next_state is None else kind.next_state]
            f, g_k, next_k = ca.Function("f", [kind.z], outputs)(z)
            if following is not None:
                self.miss.append(z[: kind.x.numel()] - following)
            cost, following = cost + f, next_k
            g.append(g_k)
        self.w, self.cost, self.miss, self.g = w, cost, ca.vertcat(NONE, *self.miss), ca.vertcat(*g)

    def at(self, point, lam_x, lam_g):
        """Return gradient of the cost, Hessian of the Lagrangian, Jacobians and values of miss and g."""
        lagrangian = self.cost + ca.dot(lam_x, self.miss) + ca.dot(lam_g, self.g)
        H, _ = ca.hessian(lagrangian, self.w)
        outputs = [ca.gradient(self.cost, self.w), H]
        outputs += [ca.jacobian(self.miss, self.w), ca.jacobian(self.g, self.w), self.miss, self.g]
        return [ca.DM(value).full() for value in ca.Function("whole", [self.w], outputs)(point)]


@pytest.mark.parametrize(("kinds", "fixed"), [(kinds, FIXED), (kinds, np.zeros(0, int)), (many_entries, np.array([3]))])
def test_the_step_meets_the_optimality_conditions_of_the_whole_problem(kinds, fixed):
    kinds, rng = kinds(), np.random.default_rng(0)
    stages, whole = StageSequence(kinds, StageKind.interpreted), Whole(kinds)
    point = 0.3 * rng.normal(size=len(stages.w.values))
    stages.lam_x.values[:], stages.lam_g.values[:] = (
        0.1 * rng.normal(size=len(r.values)) for r in (stages.lam_x, stages.g)
    )
    cost = stages.evaluate(point)
    stages.differentiate()
    gradient, H, J_miss, J_g, miss, g = whole.at(point, stages.lam_x.values, stages.lam_g.values)
    assert cost == pytest.approx(float(ca.Function("cost", [whole.w], [whole.cost])(point)))
    np.testing.assert_allclose(stages.gradient.values, gradient.ravel(), atol=1e-12)

    n = len(stages.lower)
    weight, slope, c_fixed = rng.uniform(0.5, 2.0, size=n), rng.normal(size=n), rng.normal(size=len(fixed))
    J, A = J_g[~stages.equality], np.vstack([J_miss, J_g[stages.equality], np.eye(len(point))[fixed]])
    c = np.concatenate([miss.ravel(), g.ravel()[stages.equality], c_fixed])
    newton = NewtonSystem(stages, fixed)
    newton.write(Terms(stages.gradient.values, np.full(len(point), 10.0), weight, slope), c)
    assert newton.solve()

    dw, lam = newton.step(), newton.multipliers()
    stationarity = (H + 10.0 * np.eye(len(point)) + J.T @ np.diag(weight) @ J) @ dw + gradient.ravel() + J.T @ slope
    np.testing.assert_allclose(stationarity + A.T @ lam, 0.0, atol=1e-9)
    np.testing.assert_allclose(A @ dw + c, 0.0, atol=1e-9)
    np.testing.assert_allclose(newton.inequality_change(), J @ dw, atol=1e-12)
