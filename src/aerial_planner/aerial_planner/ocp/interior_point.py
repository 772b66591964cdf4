"""Primal-dual interior-point method for multi-stage problems, its Newton steps by the constrained Riccati recursion.

    min  f(w)   s.t.  c(w) = 0 ,   d(w) = s ,   l ≤ s ≤ u

c: dynamics and equalities, d: inequalities and bounded variables, each with a slack. The barrier −μ Σ ln of the slacks'
distances to their bounds takes the place of l and u; μ falls in steps. Each Newton step is a linear-quadratic problem
(``newton``, ``riccati``); how far to go along it is decided by a ``filter``, and where a direction without curvature is free, a
multiple of the identity is added to the Hessian (``regularization``). This is IPOPT's method with its constants, without
the restoration phase: Wächter and Biegler, *On the implementation of an interior-point filter line-search algorithm for
large-scale nonlinear programming*, Mathematical Programming 106 (2006), whose equations the numbers below are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from aerial_planner.ocp import barrier
from aerial_planner.ocp.barrier import Bounds
from aerial_planner.ocp.filter import Filter, Merit
from aerial_planner.ocp.newton import NewtonSystem, Terms
from aerial_planner.ocp.options import Outcome, SolverOptions
from aerial_planner.ocp.regularization import Regularization
from aerial_planner.ocp.sequence import StageSequence
from aerial_planner.ocp.stage import Rows, StageEvaluation, StageKind

_SLOWER, _FASTER = 0.2, 1.5  # κ_μ, θ_μ of (7)
_SCALE_MAX = 100.0  # s_max of (6)
_TO_BOUND = 0.99  # τ_min of (8)
_CORRECTIONS, _CORRECTION_GAIN = 4, 0.99  # p_max, κ_soc of the second-order correction
_SHORTEST = 1e-7  # share of the longest step that counts as none
_VIOLATION = 0.1  # share of the tolerance by which constraints may be missed: steps near the optimum are worth it
_BARRIER_LEAST = 0.1  # of the tolerance: μ of the last barrier problem


class InteriorPoint:
    """One sequence of stage kinds, solved for many requests; variables are w = (x_0, u_0, x_1, u_1, …).

    Requests share its memory: they come one after the other.

    Args:
        kinds: stage kind of each stage.
        evaluation_of: returns the functions of a stage kind.
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
        self._newton: dict[bytes, NewtonSystem] = {}  # by which variables are fixed

    def solve(self, w: np.ndarray, p: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> Outcome:
        """Return where the iteration from ``w`` ends.

        Args:
            w: guess ``(n_w,)``.
            p: parameters of all stages ``(n_p,)``.
            lower: bounds of w ``(n_w,)``, equal to the upper ones where a variable is fixed.
            upper: bounds of w ``(n_w,)``.
        """
        self._stages.p.values[:] = p
        fixed = lower == upper
        key = fixed.tobytes()
        if key not in self._newton:
            self._newton[key] = NewtonSystem(self._stages, np.flatnonzero(fixed))
        return _Iteration(self._options, self._stages, self._newton[key], w, (lower, upper)).run()

    def constraints(self, w: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return for each stage the misses of its dynamics, then its constraints, in one row."""
        self._stages.p.values[:] = p
        self._stages.evaluate(w)
        return self._stages.constraints()


@cache
def rehearse() -> None:
    """Solve a problem of two stages, so that whatever Numba compiles is compiled, or read from its cache, before a plan."""
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


class _Point(NamedTuple):
    """Where the iteration is, and what the functions are there."""

    w: np.ndarray  # (n_w,)
    s: np.ndarray  # (m,) slacks
    cost: float
    c: np.ndarray  # misses of dynamics, equalities and fixed variables
    gap: np.ndarray  # (m,) d − s
    theta: float  # violation
    logarithms: float  # of the slacks' distances to their bounds, summed

    def merit(self, mu: float) -> Merit:
        """Return violation, and cost with barrier."""
        return Merit(self.theta, self.cost - mu * self.logarithms)


class _Direction(NamedTuple):
    """A Newton step, and the multipliers after it."""

    dw: np.ndarray  # (n_w,)
    ds: np.ndarray  # (m,)
    lam: np.ndarray  # of c
    nu: np.ndarray  # (m,) of d − s


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


class _Iteration:
    """The iteration of one solve.

    Args:
        options: of the method.
        stages: of the problem, whose parameters are written.
        newton: system of the problem with the fixed variables of these limits.
        w: guess ``(n_w,)``.
        limits: lower and upper bounds of w ``(n_w,)``.
    """

    def __init__(
        self,
        options: SolverOptions,
        stages: StageSequence,
        newton: NewtonSystem,
        w: np.ndarray,
        limits: tuple[np.ndarray, np.ndarray],
    ) -> None:
        self.options, self.stages, self.newton = options, stages, newton
        lower, upper = limits
        self.bounded = np.flatnonzero((lower < upper) & (np.isfinite(lower) | np.isfinite(upper)))
        self.fixed = np.flatnonzero(lower == upper)
        self.fixed_at = lower[self.fixed]
        self.bounds = Bounds.of(
            np.concatenate([stages.lower, lower[self.bounded]]), np.concatenate([stages.upper, upper[self.bounded]])
        )
        self.n_bounds = self.bounds.n_finite
        self.unequal, self.equal = np.flatnonzero(~stages.equality), np.flatnonzero(stages.equality)
        self.mu = options.initial_barrier
        w = np.where(lower == upper, lower, w)
        stages.evaluate(w)
        s = self.bounds.interior(self._inequalities(w), options.bound_distance)
        self.z_low, self.z_high = self.bounds.has_low.astype(float), self.bounds.has_high.astype(float)
        self.weight, self.slope = np.empty_like(s), np.empty_like(s)  # Σ of the barrier and its gradient, at the point
        self.lam = np.zeros(len(stages.miss.values) + len(self.equal) + len(self.fixed))
        self.nu = self.z_high - self.z_low
        self.point = self._at(w, s)
        self.filter = Filter(self.point.theta)
        self.regularization = Regularization()
        self.delta = 0.0  # δ_w of the present step

    def run(self) -> Outcome:
        """Iterate until an optimum, the last iteration or a step that leads nowhere."""
        options, status = self.options, "iterations exceeded"
        for iteration in range(options.max_iterations + 1):
            self._differentiate()
            if not np.isfinite(self.point.merit(self.mu).phi):
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
            w=self.point.w, cost=self.point.cost, iterations=iteration, status=status, converged=status == "solved"
        )

    # --- where we are -----------------------------------------------------------------------------------------------

    def _inequalities(self, w: np.ndarray) -> np.ndarray:
        return np.concatenate([self.stages.g.values[self.unequal], w[self.bounded]])

    def _at(self, w: np.ndarray, s: np.ndarray) -> _Point:
        stages, cost = self.stages, self.stages.evaluate(w)
        c = np.concatenate([stages.miss.values, stages.equality_miss(), w[self.fixed] - self.fixed_at])
        gap = self._inequalities(w) - s
        theta = barrier.norm_1(c) + barrier.norm_1(gap)
        return _Point(w=w, s=s, cost=cost, c=c, gap=gap, theta=theta, logarithms=barrier.logarithms(self.bounds, s))

    def _differentiate(self) -> None:
        """Evaluate all derivatives at the point (at which the functions were evaluated last)."""
        stages, n_rows = self.stages, len(self.unequal)
        n_x, n_e = len(stages.miss.values), len(self.equal)
        stages.lam_x.values[:] = self.lam[:n_x]
        stages.lam_g.values[self.equal] = self.lam[n_x : n_x + n_e]
        stages.lam_g.values[self.unequal] = self.nu[:n_rows]
        stages.differentiate()
        stages.lagrangian.values[self.bounded] += self.nu[n_rows:]
        stages.lagrangian.values[self.fixed] += self.lam[n_x + n_e :]

    def _errors(self) -> _Errors:
        """Return how far the point is from an optimum (5)."""
        z_low, z_high, point, n_z = self.z_low, self.z_high, self.point, self.n_bounds
        duals = barrier.norm_1(z_low) + barrier.norm_1(z_high)
        s_d = max(_SCALE_MAX, (barrier.norm_1(self.lam) + duals) / max(1, len(self.lam) + n_z)) / _SCALE_MAX
        s_c = max(_SCALE_MAX, duals / max(1, n_z)) / _SCALE_MAX
        lagrangian = self.stages.lagrangian.values
        slope, violation = barrier.residuals(lagrangian, self.nu, z_low, z_high, point.c, point.gap)
        least, most = barrier.complementarity(self.bounds, point.s, z_low, z_high)
        return _Errors(slope=slope / s_d, violation=violation, least=least / s_c, most=most / s_c, per_mu=1.0 / s_c)

    def _lower_barrier(self, errors: _Errors) -> None:
        """Go on to the next barrier problems (7) while the present one is solved well enough."""
        least = _BARRIER_LEAST * self.options.tolerance
        while self.mu > least and errors.of(self.mu) <= self.options.barrier_accuracy * self.mu:
            self.mu = max(least, min(_SLOWER * self.mu, self.mu**_FASTER))
            self.filter.clear()

    # --- one step ---------------------------------------------------------------------------------------------------

    def _step(self) -> bool:
        """Take one step; return False if there is none that the filter accepts."""
        point = self.point
        barrier.derivatives(self.bounds, point.s, self.z_low, self.z_high, self.mu, self.weight, self.slope)
        direction = self._direction(point.c, point.gap)
        while direction is not None:
            accepted = self._search(direction)
            if accepted is not None:
                length, self.point = accepted
                self._move_multipliers(point, length, direction)
                return True
            delta = self.regularization.after_rejection()
            if delta is None:
                return False
            direction = self._direction(point.c, point.gap, delta)
        return False

    def _direction(self, c: np.ndarray, gap: np.ndarray, delta: float = 0.0) -> _Direction | None:
        """Return the Newton step (13) for these residuals, with at least this δ_w; None if there is none."""
        newton, n_rows = self.newton, len(self.unequal)
        weight, slope = self.weight, self.slope
        pull = weight * gap + slope  # the slacks' share of the gradient, once ds = J dw + gap is substituted
        gradient, diagonal = self.stages.gradient.values.copy(), np.full(len(self.point.w), delta)
        gradient[self.bounded] += pull[n_rows:]
        diagonal[self.bounded] += weight[n_rows:]
        newton.write(Terms(gradient, diagonal, weight[:n_rows], pull[:n_rows]), c)
        while not newton.solve():
            more = self.regularization.more(delta)
            if more is None:
                return None
            newton.add_to_diagonal(more - delta)
            delta = more
        self.delta = delta
        if delta > 0.0:
            self.regularization.last = delta
        dw = newton.step()
        ds = np.concatenate([newton.inequality_change(), dw[self.bounded]]) + gap
        return _Direction(dw, ds, newton.multipliers(), slope + weight * ds)

    def _to_bounds(self, ds: np.ndarray) -> float:
        """Return how much of the step the slacks allow (15a)."""
        return barrier.step_length(self.bounds, self.point.s, ds, self._keep)

    @property
    def _keep(self) -> float:
        """Share of a distance that a step may use up, τ of (8)."""
        return max(_TO_BOUND, 1.0 - self.mu)

    def _search(self, direction: _Direction) -> tuple[float, _Point] | None:
        """Return how far along the step to go, and the point there (section 2.3); None: nowhere."""
        point, (dw, ds, _, _) = self.point, direction
        descent = float(self.stages.gradient.values @ dw + self.slope @ ds)
        longest = length = self._to_bounds(ds)
        while length > _SHORTEST * longest:
            trial = self._at(point.w + length * dw, point.s + length * ds)
            if self._accepts(trial, length, descent):
                return length, trial
            if length == longest and trial.theta >= point.theta:
                corrected = self._corrected(trial, length, descent)
                if corrected is not None:
                    return length, corrected
            length *= 0.5
        return None

    def _corrected(self, trial: _Point, length: float, descent: float) -> _Point | None:
        """Return a point that the second-order correction (section 2.4) reaches and the filter accepts, or None."""
        point, before = self.point, self.point.theta
        c, gap = point.c.copy(), point.gap.copy()
        step = length
        for _ in range(_CORRECTIONS):
            if not np.isfinite(trial.theta):
                return None
            c, gap = step * c + trial.c, step * gap + trial.gap
            direction = self._direction(c, gap, self.delta)
            if direction is None:
                return None
            step = self._to_bounds(direction.ds)
            trial = self._at(point.w + step * direction.dw, point.s + step * direction.ds)
            if self._accepts(trial, length, descent):
                return trial
            if trial.theta > _CORRECTION_GAIN * before:
                return None
            before = trial.theta
        return None

    def _accepts(self, trial: _Point, length: float, descent: float) -> bool:
        return self.filter.accepts(trial.merit(self.mu), self.point.merit(self.mu), length, descent)

    def _move_multipliers(self, point: _Point, length: float, direction: _Direction) -> None:
        """Move the multipliers of the point that was left (14), and keep those of bounds in range (16)."""
        self.lam += length * (direction.lam - self.lam)
        self.nu += length * (direction.nu - self.nu)
        barrier.update_multipliers(
            self.bounds, point.s, self.point.s, direction.ds, self.z_low, self.z_high, self.mu, self._keep
        )
