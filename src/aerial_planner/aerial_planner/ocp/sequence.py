"""The functions of all stages of a problem, evaluated in shared memory.

Functions read and write NumPy's memory without copies; those of a stage kind are evaluated at all consecutive stages of that
kind at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from aerial_planner.ocp.ragged import Ragged
from aerial_planner.ocp.sparsity import Pattern, Tables
from aerial_planner.ocp.stage import StageEvaluation, StageKind


class StageSequence:
    """All stages of a problem: variables w = (x_0, u_0, x_1, u_1, …) in, values and derivatives out.

    Args:
        kinds: stage kind of each stage.
        evaluation_of: returns the functions of a stage kind.

    Attributes:
        nx: number of states of each stage ``(K,)``.
        nu: number of controls ``(K,)``.
        n_equal: number of equalities among the constraints ``(K,)``.
        equality: which of all constraints are equalities ``(n_g,)`` bool.
        lower: bounds of the other constraints, the inequalities.
        upper: bounds of the inequalities.
        p: parameters of each stage, to be written before ``evaluate``.
        w: variables of each stage.
        miss: x_k+1 − next_k of each stage; ``evaluate`` writes it.
        g: constraints of each stage; ``evaluate`` writes them.
        lam_x: multipliers of ``miss``, to be written before ``differentiate``.
        lam_g: multipliers of ``g``, to be written before ``differentiate``.
        gradient: of the cost, as w; ``differentiate`` writes it.
        lagrangian: gradient of the Lagrangian, as w; ``differentiate`` writes it.
        derivatives: Jacobians and Hessians; ``differentiate`` writes them.
        tables: where the nonzeros of the derivatives belong.
        links: row and column in (u, x) of each nonzero of each stage's ∂next/∂(u, x) ``(n_F, 2)``.
    """

    def __init__(self, kinds: Sequence[StageKind], evaluation_of: Callable[[StageKind], StageEvaluation]) -> None:
        self.nx = np.array([kind.x.numel() for kind in kinds])
        self.nu = np.array([kind.u.numel() for kind in kinds])
        n_z, n_g, n_next = self.nx + self.nu, [kind.constraints.numel() for kind in kinds], [k.n_next for k in kinds]
        self.w, self.gradient, self.lagrangian = (Ragged.zeros(n_z) for _ in range(3))
        self.g, self.lam_g = Ragged.zeros(n_g), Ragged.zeros(n_g)
        self.miss, self.lam_x, self._next = (Ragged.zeros(n_next) for _ in range(3))
        self.p, self._cost = Ragged.zeros([kind.p.numel() for kind in kinds]), Ragged.zeros([1] * len(kinds))
        self._set_bounds(kinds)

        next_x = [self.w.starts[k + 1] + np.arange(n) for k, n in enumerate(n_next)]
        self._next_x = np.concatenate(next_x).astype(np.int64)  # where in w the state is that each row of ``miss`` has
        stages = np.arange(len(kinds))
        self._by_stage = np.argsort(np.concatenate([np.repeat(stages, n_next), np.repeat(stages, n_g)]), kind="stable")

        first = [k for k in range(len(kinds)) if k == 0 or kinds[k] is not kinds[k - 1]]  # stage of each run
        end = [*first[1:], len(kinds)]
        run = np.repeat(np.arange(len(first)), np.subtract(end, first))
        evaluations = [evaluation_of(kinds[k]) for k in first]
        patterns = [Pattern.of(kinds[k], evaluation) for k, evaluation in zip(first, evaluations, strict=True)]
        self.tables, self.derivatives = Tables.of(patterns, run, self.nx, self.nu), Tables.memory(patterns, run)
        self.links = [patterns[r].F_at for r in run]
        self._values: list[Callable[[], object]] = []
        self._derivatives: list[Callable[[], object]] = []
        for evaluation, *stages_of_run in zip(evaluations, first, end, strict=True):
            self._bind(evaluation, *stages_of_run)

    def evaluate(self, w: np.ndarray) -> float:
        """Fill ``miss`` and ``g`` at w ``(n_w,)`` and return the cost."""
        self.w.values[:] = w
        for evaluate in self._values:
            evaluate()
        np.subtract(self.w.values[self._next_x], self._next.values, out=self.miss.values)
        return float(self._cost.values.sum())

    def differentiate(self) -> None:
        """Fill the gradients and ``derivatives``, at the w that was evaluated last and the multipliers that were written."""
        for evaluate in self._derivatives:
            evaluate()
        self.lagrangian.values[self._next_x] += self.lam_x.values

    def equality_miss(self) -> np.ndarray:
        """Return by how much the equalities among the constraints are missed."""
        miss: np.ndarray = self.g.values[self.equality] - self._equal_to
        return miss

    def constraints(self) -> np.ndarray:
        """Return misses of the dynamics and constraints, stage by stage."""
        return np.concatenate([self.miss.values, self.g.values])[self._by_stage]

    def _set_bounds(self, kinds: Sequence[StageKind]) -> None:
        lower, upper = (np.concatenate([getattr(kind, side) for kind in kinds]) for side in ("lower", "upper"))
        self.equality = lower == upper
        self._equal_to = lower[self.equality]
        self.lower, self.upper = lower[~self.equality], upper[~self.equality]
        self.n_equal = np.array([int((kind.lower == kind.upper).sum()) for kind in kinds])

    def _bind(self, evaluation: StageEvaluation, first: int, end: int) -> None:
        """Bind the functions of a run of stages of one kind to this memory."""

        def rows(*ragged: Ragged) -> list[np.ndarray]:
            return [row.span(first, end) for row in ragged]

        n, d = end - first, self.derivatives
        arguments = rows(self.w, self.p)
        self._values.append(evaluation.values.bind(n, arguments, rows(self._cost, self._next, self.g)))
        arguments = rows(self.w, self.p, self.lam_x, self.lam_g)
        results = rows(self.gradient, d.F, d.G, self.lagrangian, d.H)
        self._derivatives.append(evaluation.derivatives.bind(n, arguments, results))
