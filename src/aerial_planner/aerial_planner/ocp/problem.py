"""Multi-stage optimal control problems, written one stage at a time and solved by an interior-point method.

A *stage kind* holds the CasADi expressions of one stage: next state, cost, constraints. A *problem* is a sequence of
stage kinds. Derivatives (exact Hessian included) are made once per kind and evaluated at all stages of that kind, so that
building a problem costs as much as differentiating a handful of stages, and a built problem serves every request of the
same sequence: all numbers enter as stage parameters and bounds.

    min  Σ_k cost_k(x_k, u_k, p_k)
    s.t. x_k+1 = next_k(x_k, u_k, p_k),   lower_k ≤ constraint_k(x_k, u_k, p_k) ≤ upper_k ,  bounds on x_k, u_k .
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from aerial_planner.codegen.library import FunctionLibrary
from aerial_planner.ocp.casadi_nlp import FlatProgram
from aerial_planner.ocp.interior_point import InteriorPoint
from aerial_planner.ocp.options import SolverName, SolverOptions
from aerial_planner.ocp.ragged import starts_of
from aerial_planner.ocp.stage import StageData, StageEvaluation, StageKind

_ACTIVE = 1e-3  # distance to its bound below which an inequality is active
_DEFAULTS = SolverOptions()


@dataclass(frozen=True, kw_only=True)
class Solution:
    """What a solver returned, stage by stage; to be used only if ``converged`` and ``max_violation`` allow."""

    x: list[np.ndarray]  # (n_x,) of each stage
    u: list[np.ndarray]  # (n_u,) of each stage
    cost: float
    iterations: int
    status: str
    converged: bool
    max_violation: float  # of any constraint or bound
    binding: tuple[str, ...]  # labels of the active inequalities, those of most stages first


class Problem:
    """A sequence of stage kinds, built once and solved for many requests.

    Args:
        kinds: stage kind of each stage; stages with the same object share functions.
        options: of the solver.
        library: of compiled stage functions, for our own solver; None: interpreted ones.

    Raises:
        ValueError: if a kind does not lead to the states of the next one.
    """

    def __init__(
        self,
        kinds: Sequence[StageKind],
        options: SolverOptions = _DEFAULTS,
        library: FunctionLibrary | None = None,
    ) -> None:
        for kind, following in pairwise(kinds):
            if kind.n_next != following.x.numel():
                raise ValueError(
                    f"stage {kind.name} leads to {kind.n_next} states, {following.name} has {following.x.numel()}"
                )
        self.kinds = list(kinds)
        self.options = options
        self._library = library
        starts = starts_of([n for kind in kinds for n in (kind.x.numel(), kind.u.numel())]).tolist()
        self._parts = [slice(*pair) for pair in pairwise(starts)]  # of w: x_0, u_0, x_1, …
        rows = [(np.zeros(kind.n_next), kind.lower, kind.upper) for kind in kinds]
        self._lower = np.concatenate([part for zero, low, _ in rows for part in (zero, low)])
        self._upper = np.concatenate([part for zero, _, up in rows for part in (zero, up)])
        self._labels = [label for kind in kinds for label in ("dynamics",) * kind.n_next + kind.labels]
        self._solver: InteriorPoint | FlatProgram
        if SolverName(options.solver) is SolverName.RICCATI:
            self._solver = InteriorPoint(self.kinds, self._evaluation_of, options)
        else:
            self._solver = FlatProgram(self.kinds, options)

    def solve(self, stages: Sequence[StageData]) -> Solution:
        """Return the local optimum that the solver finds from the guess.

        Args:
            stages: parameters, bounds and guess of each stage.
        """
        guess, p, lower, upper = _flat(stages)
        outcome = self._solver.solve(guess, p, lower, upper)
        g = self._solver.constraints(outcome.w, p)
        finite = bool(np.all(np.isfinite(outcome.w)))
        at_bound = (self._lower < self._upper) & (np.minimum(g - self._lower, self._upper - g) < _ACTIVE)
        active = Counter(self._labels[row] for row in np.flatnonzero(at_bound))
        parts = [outcome.w[part] for part in self._parts]
        return Solution(
            x=parts[::2],
            u=parts[1::2],
            cost=outcome.cost,
            iterations=outcome.iterations,
            status=outcome.status,
            converged=outcome.converged and finite,
            max_violation=self._excess(outcome.w, lower, upper, g) if finite else float("inf"),
            binding=tuple(label for label, _ in active.most_common()),
        )

    def violation(self, stages: Sequence[StageData]) -> float:
        """Return the largest violation of any constraint or bound at the stages' guess."""
        w, p, lower, upper = _flat(stages)
        return self._excess(w, lower, upper, self._solver.constraints(w, p))

    def _evaluation_of(self, kind: StageKind) -> StageEvaluation:
        compiled = self._library.load(kind) if self._library else None
        return StageEvaluation(*compiled) if compiled else kind.interpreted()

    def _excess(self, w: np.ndarray, lower: np.ndarray, upper: np.ndarray, g: np.ndarray) -> float:
        """Return the largest violation of bounds on the variables ``w`` and on the constraints ``g``."""
        misses = np.concatenate([lower - w, w - upper, self._lower - g, g - self._upper])
        return float(np.max(misses, initial=0.0))


def _flat(stages: Sequence[StageData]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return guess, parameters and bounds of all stages in one row each."""
    guess = [part for s in stages for part in (s.x, s.u)]
    lower = [part for s in stages for part in (s.x_min, s.u_min)]
    upper = [part for s in stages for part in (s.x_max, s.u_max)]
    return np.concatenate(guess), np.concatenate([s.p for s in stages]), np.concatenate(lower), np.concatenate(upper)
