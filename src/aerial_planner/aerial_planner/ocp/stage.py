"""One knot of an optimal control problem, as expressions: next state, cost, constraints; and its numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from aerial_planner.codegen.batch import Interpreted, Pointwise
from aerial_planner.kinematics.base_frame import conjugate, quaternion_product

_SAME_TURN = 0.5  # least q_goal · q of an attitude that is the goal's


@dataclass(frozen=True, kw_only=True, eq=False)
class StageKind:
    """The expressions of one kind of knot; ``next_state`` is None at the last one.

    Constraint bounds that are numbers of the problem rather than of the request are given here. Cost and constraints may
    say ``y`` for ``y_is``: derivatives are then made by the chain rule through few variables, which keeps them short.
    """

    name: str
    x: ca.SX  # (n_x,)
    u: ca.SX  # (n_u,), possibly empty
    p: ca.SX  # (n_p,) stage parameters
    cost: ca.SX  # scalar
    next_state: ca.SX | None
    constraints: ca.SX  # (n_g,)
    lower: np.ndarray  # (n_g,); equal to upper: an equality
    upper: np.ndarray  # (n_g,)
    labels: tuple[str, ...]  # what each constraint is, for people
    y: ca.SX = field(default_factory=lambda: ca.SX(0, 1))  # (n_y,)
    y_is: ca.SX = field(default_factory=lambda: ca.SX(0, 1))  # (n_y,) of x, u and p

    def __post_init__(self) -> None:
        for what, expression in (("next_state", self._dynamics), ("y_is", self.y_is)):
            if self.y.numel() > 0 and ca.depends_on(expression, self.y):
                raise ValueError(f"stage {self.name}: {what} must not depend on y")

    @property
    def n_next(self) -> int:
        """Number of states of the next knot."""
        return 0 if self.next_state is None else self.next_state.numel()

    @property
    def _dynamics(self) -> ca.SX:
        return ca.SX(0, 1) if self.next_state is None else self.next_state

    @property
    def z(self) -> ca.SX:
        """States and controls ``(n_x + n_u,)``."""
        return ca.vertcat(self.x, self.u)

    def functions(self) -> StageFunctions:
        """Return the kind's functions and derivatives; making them is what takes time in building a problem."""
        z, p = self.z, self.p
        lam_f = ca.SX.sym("lam_f")
        multipliers, lagrangian, H = self._lagrangian(lam_f)
        return StageFunctions(
            values=self._function("values", [z, p], self._values),
            gradient=self._function("gradient", [z, p], [self._gradient]),
            jacobian=self._function("jacobian", [z, p], self._jacobians),
            hessian=self._function("hessian", [z, p, lam_f, *multipliers], [lagrangian, H]),
        )

    def together(self) -> tuple[ca.Function, ca.Function]:
        """Return what ``StageEvaluation`` evaluates: values, and derivatives all in one, which share what they can."""
        z, p = self.z, self.p
        multipliers, lagrangian, H = self._lagrangian(ca.SX(1.0))
        derivatives = [self._gradient, *self._jacobians, lagrangian, H]
        return (
            self._function("values", [z, p], self._values),
            self._function("derivatives", [z, p, *multipliers], derivatives),
        )

    def interpreted(self) -> StageEvaluation:
        """Return the kind's functions as CasADi evaluates them."""
        return StageEvaluation(*map(Interpreted, self.together()))

    @property
    def _values(self) -> list[ca.SX]:
        return [self.cost, self._dynamics, ca.densify(self.constraints)]

    @property
    def _gradient(self) -> ca.SX:
        return ca.densify(self._through_y(ca.jacobian(self.cost, self._zy)).T)

    @property
    def _jacobians(self) -> list[ca.SX]:
        return [ca.jacobian(-self._dynamics, self.z), self._through_y(ca.jacobian(self.constraints, self._zy))]

    def _lagrangian(self, lam_f: ca.SX) -> tuple[list[ca.SX], ca.SX, ca.SX]:
        """Return the multipliers of dynamics and constraints, and gradient and Hessian of the Lagrangian."""
        lam_x, lam_g = ca.SX.sym("lam_x", self.n_next), ca.SX.sym("lam_g", self.constraints.numel())
        lagrangian = lam_f * self.cost - ca.dot(lam_x, self._dynamics) + ca.dot(lam_g, self.constraints)
        H, gradient = ca.hessian(lagrangian, self._zy)
        H = self._through_y(self._through_y(H).T)
        if self.y.numel() > 0:
            slope = ca.SX.sym("slope", self.y.numel())
            bend, _ = ca.hessian(ca.dot(slope, self.y_is), self.z)
            H += ca.substitute(bend, slope, gradient[self.z.numel() :])
        return [lam_x, lam_g], ca.densify(self._through_y(gradient.T).T), H

    @property
    def _zy(self) -> ca.SX:
        return ca.vertcat(self.z, self.y)

    def _through_y(self, J: ca.SX) -> ca.SX:
        """Return derivatives by z ``(·, n_z)`` from those by z and y ``(·, n_z + n_y)``."""
        n = self.z.numel()
        return J[:, :n] + ca.mtimes(J[:, n:], ca.jacobian(self.y_is, self.z)) if self.y.numel() > 0 else J

    def _function(self, name: str, arguments: list[ca.SX], results: list[ca.SX]) -> ca.Function:
        if self.y.numel() > 0:
            results = ca.substitute(results, [self.y], [self.y_is])
        return ca.Function(f"{self.name}_{name}", arguments, results, {"cse": True})


@dataclass(frozen=True, kw_only=True)
class StageFunctions:
    """What a solver evaluates of a stage kind; z are its states and controls."""

    values: ca.Function  # (z, p) ↦ cost, next state, constraints
    gradient: ca.Function  # (z, p) ↦ gradient of the cost
    jacobian: ca.Function  # (z, p) ↦ Jacobians of −next state and of the constraints
    hessian: ca.Function  # (z, p, λ_f, λ_dynamics, λ_constraints) ↦ gradient and Hessian of the Lagrangian


class StageEvaluation(NamedTuple):
    """The functions of a stage kind, for many knots at once."""

    values: Pointwise  # (z, p) ↦ cost, next state, constraints
    derivatives: (
        Pointwise  # (z, p, λ_dynamics, λ_constraints) ↦ those of ``StageFunctions``, in its order, with λ_f = 1
    )


class Rows:
    """Constraint rows with their bounds, collected in the order the formulation states them."""

    def __init__(self) -> None:
        self._expressions: list[ca.SX] = []
        self._lower: list[float] = []
        self._upper: list[float] = []
        self._labels: list[str] = []

    def equal(self, label: str, expression: ca.SX) -> None:
        """Add expression = 0."""
        self.between(label, expression, 0.0, 0.0)

    def between(self, label: str, expression: ca.SX, lower: float, upper: float) -> None:
        """Add lower ≤ expression ≤ upper."""
        self._expressions.append(expression)
        self._labels += [label] * expression.numel()
        self._lower += [lower] * expression.numel()
        self._upper += [upper] * expression.numel()

    def attitude(self, quaternion: ca.SX, goal: ca.SX) -> None:
        """Add quaternion = goal, and not its negative: the attitude itself, not the one a full turn away."""
        error = quaternion_product(conjugate(goal), quaternion)
        self.equal("landing attitude", error[:3])
        self.between("landing attitude", error[3], _SAME_TURN, np.inf)

    def stage(
        self, name: str, x: ca.SX, u: ca.SX, p: ca.SX, cost: ca.SX, next_state: ca.SX | None, **shorthands: ca.SX
    ) -> StageKind:
        """Return the stage kind with these rows as its constraints; ``shorthands`` are y and y_is, if there are any."""
        return StageKind(
            **shorthands,
            name=name,
            x=x,
            u=u,
            p=p,
            cost=cost,
            next_state=next_state,
            constraints=ca.vertcat(ca.SX(0, 1), *self._expressions),
            lower=np.array(self._lower),
            upper=np.array(self._upper),
            labels=tuple(self._labels),
        )


@dataclass(frozen=True, kw_only=True)
class StageData:
    """The numbers of one knot of one request."""

    p: np.ndarray  # (n_p,)
    x_min: np.ndarray  # (n_x,)
    x_max: np.ndarray
    u_min: np.ndarray  # (n_u,)
    u_max: np.ndarray
    x: np.ndarray  # guess (n_x,)
    u: np.ndarray  # guess (n_u,)

    @staticmethod
    def free(
        *,
        p: np.ndarray,
        x: np.ndarray,
        u: np.ndarray | None = None,
        x_min: np.ndarray | None = None,
        x_max: np.ndarray | None = None,
        u_min: np.ndarray | None = None,
        u_max: np.ndarray | None = None,
    ) -> StageData:
        """Return a knot's data with infinite bounds where none are given, and no control where none is."""
        u = np.zeros(0) if u is None else u
        return StageData(
            p=p,
            x=x,
            u=u,
            x_min=_infinite(len(x), -1) if x_min is None else x_min,
            x_max=_infinite(len(x), 1) if x_max is None else x_max,
            u_min=_infinite(len(u), -1) if u_min is None else u_min,
            u_max=_infinite(len(u), 1) if u_max is None else u_max,
        )


@cache
def _infinite(n: int, sign: int) -> np.ndarray:
    """Return n bounds that are none, to be read only."""
    bounds = np.full(n, sign * np.inf)
    bounds.flags.writeable = False
    return bounds
