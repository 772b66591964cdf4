"""One stage of an optimal control problem: its expressions (next state, cost, constraints), and its numbers.

A stage kind is symbolic and made once; stage data are the numbers of one stage of one request. How derivatives are made of
a kind's expressions is decided here; the machine code of functions on disk is found by the hash of this file, too.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import NamedTuple

import casadi as ca
import numpy as np

from aerial_planner.codegen.batch import Interpreted, Pointwise


@dataclass(frozen=True, kw_only=True, eq=False)
class StageKind:
    """The expressions of one kind of stage; those of several stages of a problem are equal and derived once.

        x_next = next_state(x, u, p) ,   cost(x, u, p, y) ,   lower ≤ constraints(x, u, p, y) ≤ upper ,   y = y_is(x, u, p)

    Numbers that differ between requests are parameters p; the constraints' bounds are the same in all requests. The
    intermediate quantities y are optional: where cost and constraints depend on many variables through a few y,
    derivatives made by the chain rule through y are shorter.

    Raises:
        ValueError: if the next state or ``y_is`` depends on y.
    """

    name: str
    x: ca.SX  # (n_x,)
    u: ca.SX  # (n_u,), possibly empty
    p: ca.SX  # (n_p,) stage parameters
    cost: ca.SX  # scalar
    next_state: ca.SX | None  # (n_x of the next stage,); None at the last stage
    constraints: ca.SX  # (n_g,)
    lower: np.ndarray  # (n_g,); equal to upper: an equality
    upper: np.ndarray  # (n_g,)
    labels: tuple[str, ...]  # what each constraint is, in words
    y: ca.SX = field(default_factory=lambda: ca.SX(0, 1))  # (n_y,)
    y_is: ca.SX = field(default_factory=lambda: ca.SX(0, 1))  # (n_y,) of x, u and p

    def __post_init__(self) -> None:
        for what, expression in (("next_state", self._dynamics), ("y_is", self.y_is)):
            if self.y.numel() > 0 and ca.depends_on(expression, self.y):
                raise ValueError(f"stage {self.name}: {what} must not depend on y")

    @property
    def n_next(self) -> int:
        """Number of states of the next stage, 0 at the last one."""
        return 0 if self.next_state is None else self.next_state.numel()

    @property
    def _dynamics(self) -> ca.SX:
        return ca.SX(0, 1) if self.next_state is None else self.next_state

    @property
    def z(self) -> ca.SX:
        """States and controls ``(n_x + n_u,)``."""
        return ca.vertcat(self.x, self.u)

    @property
    def batch_names(self) -> tuple[str, str]:
        """Names of ``batch_functions``."""
        return f"{self.name}_values", f"{self.name}_derivatives"

    @property
    def derivation(self) -> Path:
        """Source file that derives functions from expressions."""
        return Path(__file__)

    def expressions(self) -> ca.Function:
        """Return all that the functions are derived from, as one function (x, u, p, y) ↦ cost, constraints, y_is, …."""
        outputs = [self.cost, self.constraints, self.y_is, *([] if self.next_state is None else [self.next_state])]
        return ca.Function(self.name, [self.x, self.u, self.p, self.y], outputs)

    def nlp_functions(self) -> StageFunctions:
        """Return functions and derivatives as solvers of flat programs need them, each by itself; takes long."""
        z, p = self.z, self.p
        lam_f = ca.SX.sym("lam_f")
        multipliers, lagrangian, H = self._lagrangian(lam_f)
        return StageFunctions(
            values=self._function("values", [z, p], self._values),
            gradient=self._function("gradient", [z, p], [self._gradient]),
            jacobian=self._function("jacobian", [z, p], self._jacobians),
            hessian=self._function("hessian", [z, p, lam_f, *multipliers], [lagrangian, H]),
        )

    def batch_functions(self) -> tuple[ca.Function, ca.Function]:
        """Return what ``StageEvaluation`` evaluates: values, and all derivatives in one function; takes long."""
        z, p = self.z, self.p
        multipliers, lagrangian, H = self._lagrangian(ca.SX(1.0))
        derivatives = [self._gradient, *self._jacobians, lagrangian, H]
        return (
            self._function("values", [z, p], self._values),
            self._function("derivatives", [z, p, *multipliers], derivatives),
        )

    def interpreted(self) -> StageEvaluation:
        """Return the kind's functions as CasADi's virtual machine evaluates them."""
        values, derivatives = self.batch_functions()
        return StageEvaluation(Interpreted(values), Interpreted(derivatives))

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
    """What solvers of flat programs evaluate of a stage kind; z = (x, u) are its variables."""

    values: ca.Function  # (z, p) ↦ cost, next state, constraints
    gradient: ca.Function  # (z, p) ↦ gradient of the cost
    jacobian: ca.Function  # (z, p) ↦ Jacobians of −next state and of the constraints
    hessian: ca.Function  # (z, p, λ_f, λ_dynamics, λ_constraints) ↦ gradient and Hessian of the Lagrangian


class StageEvaluation(NamedTuple):
    """The functions of a stage kind, each evaluated at many stages at once; z = (x, u) are a stage's variables."""

    values: Pointwise  # (z, p) ↦ cost, next state, constraints
    # (z, p, λ_dynamics, λ_constraints) ↦ gradient of the cost, Jacobians of −next state and of the constraints, gradient
    # and Hessian of the Lagrangian
    derivatives: Pointwise


class Rows:
    """Constraint rows with their bounds, collected in the order a formulation states them."""

    def __init__(self) -> None:
        self._expressions: list[ca.SX] = []
        self._lower: list[float] = []
        self._upper: list[float] = []
        self._labels: list[str] = []

    def equal(self, label: str, expression: ca.SX) -> None:
        """Add the constraints expression = 0, an entry each, under one label."""
        self.between(label, expression, 0.0, 0.0)

    def between(self, label: str, expression: ca.SX, lower: float, upper: float) -> None:
        """Add the constraints lower ≤ expression ≤ upper, an entry each, under one label."""
        self._expressions.append(expression)
        self._labels += [label] * expression.numel()
        self._lower += [lower] * expression.numel()
        self._upper += [upper] * expression.numel()

    def stage(
        self, name: str, x: ca.SX, u: ca.SX, p: ca.SX, cost: ca.SX, next_state: ca.SX | None, **intermediate: ca.SX
    ) -> StageKind:
        """Return the stage kind that has these rows as its constraints.

        Args:
            name: of the kind; kinds of one problem should differ in it.
            x: symbols of the states ``(n_x,)``.
            u: symbols of the controls ``(n_u,)``.
            p: symbols of the parameters ``(n_p,)``.
            cost: scalar expression.
            next_state: expression ``(n_x of the next stage,)``; None at the last stage.
            intermediate: y and y_is of ``StageKind``, if there are any.
        """
        return StageKind(
            **intermediate,
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
    """The numbers of one stage of one request: parameters, bounds (a variable whose bounds are equal is fixed), guess."""

    p: np.ndarray  # (n_p,)
    x_min: np.ndarray  # (n_x,)
    x_max: np.ndarray  # (n_x,)
    u_min: np.ndarray  # (n_u,)
    u_max: np.ndarray  # (n_u,)
    x: np.ndarray  # (n_x,) guess
    u: np.ndarray  # (n_u,) guess

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
        """Return a stage's data, with infinite bounds where none are given and no controls where no guess of them is.

        Args:
            p: parameters ``(n_p,)``.
            x: guess of the states ``(n_x,)``.
            u: guess of the controls ``(n_u,)``.
            x_min: lower bounds of the states.
            x_max: upper bounds of the states.
            u_min: lower bounds of the controls.
            u_max: upper bounds of the controls.
        """
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
    """Return n infinite bounds of a sign, to be read only."""
    bounds = np.full(n, sign * np.inf)
    bounds.flags.writeable = False
    return bounds
