"""Interior-point method for multi-stage problems, its Newton steps by the constrained Riccati recursion.

    min  f(w)   s.t.  c(w) = 0 ,   d(w) = s ,   l ≤ s ≤ u

c: dynamics and equalities, d: inequalities and bounded variables, each with a slack. The barrier −μ Σ ln of the slacks'
distances to their bounds takes the place of l and u; μ falls in steps. Each Newton step is a linear-quadratic problem
(``riccati``); how far to go along it is decided by a filter, and where a direction without curvature is free, a multiple
of the identity is added to the Hessian. This is IPOPT's method with its constants, without the restoration phase:
Wächter, Biegler, *On the implementation of an interior-point filter line-search algorithm for large-scale nonlinear
programming*, Mathematical Programming 106 (2006), whose equations the numbers below are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from aerial_planner.ocp import barrier
from aerial_planner.ocp.barrier import Bounds
from aerial_planner.ocp.newton import StageSequence
from aerial_planner.ocp.options import Outcome, SolverOptions
from aerial_planner.ocp.riccati import LinearQuadratic
from aerial_planner.ocp.stage import Rows, StageEvaluation, StageKind

_SLOWER, _FASTER = 0.2, 1.5  # κ_μ, θ_μ of (7)
_SCALE_MAX = 100.0  # s_max of (6)
_TO_BOUND = 0.99  # τ_min of (8)
_THETA_MARGIN, _PHI_MARGIN = 1e-5, 1e-8  # γ_θ, γ_φ of (18)
_ARMIJO, _SWITCH_THETA, _SWITCH_PHI = 1e-8, 1.1, 2.3  # η_φ, s_θ, s_φ of (19), (20)
_THETA_LEAST, _THETA_MOST = 1e-4, 1e4  # of the first violation: below, descent decides; above, nothing is accepted
_CORRECTIONS, _CORRECTION_GAIN = 4, 0.99  # p_max, κ_soc of the second-order correction
_SHORTEST = 1e-7  # step length that counts as none
_CURVATURE_FIRST, _CURVATURE_LEAST, _CURVATURE_MOST = 1e-4, 1e-20, 1e10  # δ_w of algorithm IC
_CURVATURE_UP_FIRST, _CURVATURE_UP, _CURVATURE_DOWN = 100.0, 8.0, 1 / 3
_CURVATURE_TRIED = 1e6  # of which a step that the filter does not accept is tried again with more
_VIOLATION = 0.1  # of the tolerance is what constraints may be missed by: steps near the optimum are worth it
_ROUNDING = 10 * np.finfo(float).eps  # what comparisons of large sums must forgive, as a share


class InteriorPoint:
    """One sequence of stage kinds, solved for many requests; variables are w = (x_0, u_0, x_1, u_1, …).

    Requests share its memory: they come one after the other.

    Args:
        kinds: of each knot.
        evaluation_of: the functions of a kind.
        options: of the method.
    """

    def __init__(
        self,
        kinds: Sequence[StageKind],
        evaluation_of: Callable[[StageKind], StageEvaluation],
        options: SolverOptions,
    ) -> None:
        self._options = options
        self._stages = StageSequence(kinds, evaluation_of)
        self._newton: dict[bytes, LinearQuadratic] = {}  # by the number of equalities of each knot

    def solve(self, w: np.ndarray, p: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> Outcome:
        """Return where the iteration from ``w`` ends.

        Args:
            w: guess ``(n_w,)``.
            p: parameters of all knots.
            lower: bounds of w ``(n_w,)``, equal to the upper ones where a variable is fixed.
            upper: bounds of w.
        """
        stages = self._stages
        stages.p[:] = p
        fixed = np.flatnonzero(lower == upper)
        at_knot = np.searchsorted(stages.z_0, fixed, side="right") - 1
        n_equal = stages.n_equal + np.bincount(at_knot, minlength=len(stages.nx))
        key = n_equal.tobytes()
        if key not in self._newton:
            self._newton[key] = LinearQuadratic(stages.nx, stages.nu, n_equal, stages.links)
        newton = self._newton[key]
        newton.C[:] = 0.0  # where other variables may have been fixed
        return _Iteration(self._options, stages, newton, w, lower, upper).run()

    def constraints(self, w: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return for each knot the misses of its dynamics, then its constraints, in one row."""
        self._stages.p[:] = p
        self._stages.evaluate(w)
        return self._stages.constraints()


@cache
def rehearse() -> None:
    """Solve a problem of two knots, so that whatever Numba compiles is compiled, or read from its cache, before a plan."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    first, end = Rows(), Rows()
    first.equal("start", x[0] - 1.0)
    end.between("goal", x[0], -0.1, 0.1)
    none = ca.SX(0, 1)
    kinds = [
        first.stage("first", x, u, none, u**2, ca.vertcat(x[0] + u, x[1])),
        end.stage("end", x, none, none, ca.sumsqr(x), None),
    ]
    bounds = np.array([[-np.inf, 0.5, -2.0, -np.inf, -np.inf], [np.inf, 0.5, 2.0, np.inf, np.inf]])
    InteriorPoint(kinds, StageKind.interpreted, SolverOptions()).solve(np.zeros(5), np.zeros(0), *bounds)


@dataclass
class _Point:
    """Where the iteration is, and what the functions are there."""

    w: np.ndarray
    s: np.ndarray
    cost: float
    c: np.ndarray  # of the equalities
    gap: np.ndarray  # d − s
    theta: float  # violation
    logarithms: float  # of the slacks' distances to their bounds, summed


class _Errors(NamedTuple):
    """Misses of the optimality conditions, scaled as in (5)."""

    slope: float
    violation: float
    least: float  # product of distance and multiplier
    most: float
    per_mu: float

    def of(self, mu: float) -> float:
        """Return E_μ."""
        return max(self.slope, self.violation, self.most - mu * self.per_mu, mu * self.per_mu - self.least)


@dataclass
class _Iteration:
    """The iteration of one solve."""

    options: SolverOptions
    stages: StageSequence
    newton: LinearQuadratic
    w: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    curvature: float = 0.0  # δ_w that was last needed
    added: float = 0.0  # δ_w of the present step
    filter: list[tuple[float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        stages = self.stages
        bounded = (self.lower < self.upper) & (np.isfinite(self.lower) | np.isfinite(self.upper))
        self.bounded = np.flatnonzero(bounded)
        self.fixed = np.flatnonzero(self.lower == self.upper)
        low = np.concatenate([stages.lower, self.lower[self.bounded]])
        high = np.concatenate([stages.upper, self.upper[self.bounded]])
        self.bounds = Bounds.of(low, high)
        self.n_bounds = self.bounds.count
        self.unequal = np.flatnonzero(~stages.equality)
        self.equal = np.flatnonzero(stages.equality)
        self.mu = self.options.initial_barrier
        w = np.where(self.lower == self.upper, self.lower, self.w)
        stages.evaluate(w)
        s = self.bounds.pushed(self._inequalities(w), self.options.bound_distance)
        self.z_low, self.z_high = self.bounds.has_low.astype(float), self.bounds.has_high.astype(float)
        self.weight, self.slope = np.empty_like(s), np.empty_like(s)  # Σ of the barrier and its gradient, at the point
        self.lam, self.nu = np.zeros(len(stages.miss) + len(self.equal) + len(self.fixed)), self.z_high - self.z_low
        self.point = self._at(w, s)
        self._limits = (max(1.0, self.point.theta) * _THETA_LEAST, max(1.0, self.point.theta) * _THETA_MOST)

    def run(self) -> Outcome:
        """Iterate until an optimum, the last iteration or a step that leads nowhere."""
        options, status = self.options, "iterations exceeded"
        for iteration in range(options.max_iterations + 1):
            self._differentiate()
            if not np.isfinite(self._phi(self.point)):
                status = "not finite"
                break
            errors = self._errors()
            if errors.of(0.0) <= options.tolerance and errors.violation <= _VIOLATION * options.tolerance:
                status = "solved"
                break
            if iteration == options.max_iterations:
                break
            self._lower_barrier(errors)
            if not self._step():
                status = "no step"
                break
        return Outcome(
            w=self.point.w,
            cost=self.point.cost,
            iterations=iteration,
            status=status,
            converged=status == "solved",
        )

    # --- where we are -----------------------------------------------------------------------------------------------

    def _inequalities(self, w: np.ndarray) -> np.ndarray:
        return np.concatenate([self.stages.g[self.unequal], w[self.bounded]])

    def _at(self, w: np.ndarray, s: np.ndarray) -> _Point:
        cost = self.stages.evaluate(w)
        c = np.concatenate([self.stages.miss, self.stages.equality_miss(), w[self.fixed] - self.lower[self.fixed]])
        gap = self._inequalities(w) - s
        theta = barrier.norm_1(c) + barrier.norm_1(gap)
        return _Point(w=w, s=s, cost=cost, c=c, gap=gap, theta=theta, logarithms=barrier.logarithms(self.bounds, s))

    def _phi(self, point: _Point) -> float:
        """Return cost and barrier."""
        return point.cost - self.mu * point.logarithms

    def _differentiate(self) -> None:
        """Evaluate all derivatives at the point (at which the functions were evaluated last)."""
        stages, n_rows = self.stages, len(self.unequal)
        n_x, n_e = len(stages.miss), len(self.equal)
        stages.lam_x[:] = self.lam[:n_x]
        stages.lam_g[self.equal] = self.lam[n_x : n_x + n_e]
        stages.lam_g[self.unequal] = self.nu[:n_rows]
        stages.differentiate()
        stages.lagrangian[self.bounded] += self.nu[n_rows:]
        stages.lagrangian[self.fixed] += self.lam[n_x + n_e :]

    def _errors(self) -> _Errors:
        """Return how far the point is from an optimum."""
        z_low, z_high, point, n_z = self.z_low, self.z_high, self.point, self.n_bounds
        duals = barrier.norm_1(z_low) + barrier.norm_1(z_high)
        s_d = max(_SCALE_MAX, (barrier.norm_1(self.lam) + duals) / max(1, len(self.lam) + n_z)) / _SCALE_MAX
        s_c = max(_SCALE_MAX, duals / max(1, n_z)) / _SCALE_MAX
        slope, violation = barrier.misses(self.stages.lagrangian, self.nu, z_low, z_high, point.c, point.gap)
        least, most = barrier.products(self.bounds, point.s, z_low, z_high)
        return _Errors(slope=slope / s_d, violation=violation, least=least / s_c, most=most / s_c, per_mu=1.0 / s_c)

    def _lower_barrier(self, errors: _Errors) -> None:
        """Go on to the next barrier problems (7) while the present one is solved well enough."""
        least = 0.1 * self.options.tolerance
        while self.mu > least and errors.of(self.mu) <= self.options.barrier_accuracy * self.mu:
            self.mu = max(least, min(_SLOWER * self.mu, self.mu**_FASTER))
            self.filter = []

    # --- one step ---------------------------------------------------------------------------------------------------

    def _step(self) -> bool:
        """Take one step; return False if there is none that the filter accepts."""
        point = self.point
        barrier.derivatives(self.bounds, point.s, self.z_low, self.z_high, self.mu, self.weight, self.slope)
        direction = self._direction(point.c, point.gap)
        while direction is not None:
            dw, ds, lam, nu = direction
            accepted = self._search(dw, ds)
            if accepted is not None:
                length, self.point = accepted
                self._move_multipliers(point, length, ds, lam, nu)
                return True
            self.curvature = max(_CURVATURE_FIRST, _CURVATURE_UP * self.curvature)
            if self.curvature > _CURVATURE_TRIED:
                return False
            direction = self._direction(point.c, point.gap, self.curvature)
        return False

    def _direction(
        self, c: np.ndarray, gap: np.ndarray, curvature: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
        """Return the Newton step of w and s for these residuals, and the multipliers after it; None if there is none."""
        stages, newton, n_rows = self.stages, self.newton, len(self.unequal)
        weight, slope = self.weight, self.slope
        pull = weight * gap + slope
        q, diagonal = stages.gradient.copy(), np.full(len(self.w), curvature)
        q[self.bounded] += pull[n_rows:]
        diagonal[self.bounded] += weight[n_rows:]
        stages.state(newton, q, diagonal, weight[:n_rows], pull[:n_rows], c, self.fixed)
        while not newton.solve():
            more = self._more_curvature(curvature)
            if more > _CURVATURE_MOST:
                return None
            newton.add_to_diagonal(more - curvature)
            curvature = more
        self.added = curvature
        if curvature > 0.0:
            self.curvature = curvature
        dw = np.empty_like(self.w)
        lam = stages.unpack(newton, dw, self.fixed)
        ds = np.concatenate([stages.inequality_change(newton.y), dw[self.bounded]]) + gap
        return dw, ds, lam, slope + weight * ds

    def _more_curvature(self, curvature: float) -> float:
        """Return the next δ_w to try after ``curvature`` was too little (algorithm IC)."""
        if curvature == 0.0:
            return (
                _CURVATURE_FIRST if self.curvature == 0.0 else max(_CURVATURE_LEAST, _CURVATURE_DOWN * self.curvature)
            )
        return curvature * (_CURVATURE_UP_FIRST if self.curvature == 0.0 else _CURVATURE_UP)

    def _to_bounds(self, ds: np.ndarray) -> float:
        """Return how much of the step the slacks allow (15a)."""
        return barrier.step_length(self.bounds, self.point.s, ds, self._keep)

    @property
    def _keep(self) -> float:
        """Share of a distance that a step may use up, τ of (8)."""
        return max(_TO_BOUND, 1.0 - self.mu)

    def _search(self, dw: np.ndarray, ds: np.ndarray) -> tuple[float, _Point] | None:
        """Return how far along the step to go, and the point there (section 2.3); None: nowhere."""
        point = self.point
        descent = float(self.stages.gradient @ dw + self.slope @ ds)
        longest = length = self._to_bounds(ds)
        while length > _SHORTEST * longest:
            trial = self._at(point.w + length * dw, point.s + length * ds)
            if self._acceptable(trial, length, descent):
                return length, trial
            if length == longest and trial.theta >= point.theta:
                corrected = self._corrected(trial, length, descent)
                if corrected is not None:
                    return length, corrected
            length *= 0.5
        return None

    def _corrected(self, trial: _Point, length: float, descent: float) -> _Point | None:
        """Return a point that the second-order correction reaches and the filter accepts, or None."""
        point, before = self.point, self.point.theta
        c, gap = point.c.copy(), point.gap.copy()
        step = length
        for _ in range(_CORRECTIONS):
            if not np.isfinite(trial.theta):
                return None
            c, gap = step * c + trial.c, step * gap + trial.gap
            direction = self._direction(c, gap, self.added)
            if direction is None:
                return None
            dw, ds, *_ = direction
            step = self._to_bounds(ds)
            trial = self._at(point.w + step * dw, point.s + step * ds)
            if self._acceptable(trial, length, descent):
                return trial
            if trial.theta > _CORRECTION_GAIN * before:
                return None
            before = trial.theta
        return None

    def _acceptable(self, trial: _Point, length: float, descent: float) -> bool:
        """Return whether a trial is better than the point and all of the filter; enter the point into it if it must."""
        point = self.point
        theta, phi, phi_then = point.theta, self._phi(point), self._phi(trial)
        if not (np.isfinite(trial.theta) and np.isfinite(phi_then)) or trial.theta > self._limits[1]:
            return False
        if any(trial.theta >= a and phi_then >= b for a, b in self.filter):
            return False
        forgiven = _ROUNDING * abs(phi)
        descends = descent < 0.0 and length * (-descent) ** _SWITCH_PHI > theta**_SWITCH_THETA
        if descends and theta <= self._limits[0]:
            return phi_then - phi - forgiven <= _ARMIJO * length * descent
        if trial.theta > (1 - _THETA_MARGIN) * theta and phi_then - phi - forgiven > -_PHI_MARGIN * theta:
            return False
        enough = descends and phi_then - phi - forgiven <= _ARMIJO * length * descent
        if not enough:
            self.filter.append(((1 - _THETA_MARGIN) * theta, phi - _PHI_MARGIN * theta))
        return True

    def _move_multipliers(self, point: _Point, length: float, ds: np.ndarray, lam: np.ndarray, nu: np.ndarray) -> None:
        """Move the multipliers of the point that was left (14), and keep those of bounds in range (16)."""
        self.lam += length * (lam - self.lam)
        self.nu += length * (nu - self.nu)
        barrier.move_multipliers(self.bounds, point.s, self.point.s, ds, self.z_low, self.z_high, self.mu, self._keep)
