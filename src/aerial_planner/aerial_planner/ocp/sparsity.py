"""Where the nonzeros of stages' derivatives belong in the dense matrices of a linear-quadratic problem.

Functions write the nonzeros of sparse matrices one after the other, columns in the order z = (x, u) of a stage's variables; the
linear-quadratic problem has dense matrices, columns in the order y = (u, x).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from aerial_planner.ocp.ragged import Ragged, starts_of
from aerial_planner.ocp.stage import StageEvaluation, StageKind

_FEW = 8  # entries of a row, up to which its square is taken entry by entry


class Derivatives(NamedTuple):
    """Memory for the nonzeros of all stages' derivatives, as the stages' functions write them."""

    F: Ragged  # Jacobians of −next state
    G: Ragged  # Jacobians of the constraints
    H: Ragged  # Hessians of the Lagrangian


class Pattern(NamedTuple):
    """Where the nonzeros of one stage kind's derivatives belong; columns in the order y = (u, x).

    Of the constraints' Jacobian there are three tables, an entry each in a row: its number among the nonzeros, its row and
    its column.
    """

    F_at: np.ndarray  # (n_F, 2) row and column of each nonzero
    H_at: np.ndarray  # (n_H, 2) row and column of each nonzero
    n_g: int  # number of nonzeros of the constraints' Jacobian
    n_unequal: int  # number of inequalities
    equal: np.ndarray  # (·, 3) entries of equalities, rows numbered among these
    dense: np.ndarray  # (·, 3) entries of inequalities with many entries, rows numbered among these
    sparse: np.ndarray  # (·, 3) entries of inequalities with few, row by row, rows numbered among all inequalities
    dense_rows: np.ndarray  # (·,) numbers, among all inequalities, of those with many entries

    @staticmethod
    def of(kind: StageKind, evaluation: StageEvaluation) -> Pattern:
        """Return the pattern of a stage kind whose functions these are."""
        F_at, G_at, H_at = (evaluation.derivatives.nonzeros(i) for i in (1, 2, 4))
        n_x, n_u = kind.x.numel(), kind.u.numel()
        place = np.concatenate([n_u + np.arange(n_x), np.arange(n_u)]).astype(np.int64)  # in y of each entry of z
        F_at[:, 1], G_at[:, 1] = place[F_at[:, 1]], place[G_at[:, 1]]
        equal = kind.lower == kind.upper
        many = ~equal & (np.bincount(G_at[:, 0], minlength=len(equal)) > _FEW)
        return Pattern(
            F_at=F_at,
            H_at=place[H_at],
            n_g=len(G_at),
            n_unequal=int((~equal).sum()),
            equal=_entries(G_at, equal, among=equal),
            dense=_entries(G_at, many, among=many),
            sparse=_entries(G_at, ~equal & ~many, among=~equal),
            dense_rows=np.flatnonzero(many[~equal]),
        )


def _entries(G_at: np.ndarray, rows: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Return number, row and column of the nonzeros in some rows ``(·, 3)``, row by row, rows numbered ``among`` others."""
    number = np.cumsum(among) - 1
    chosen = np.flatnonzero(rows[G_at[:, 0]])
    table = np.column_stack([chosen, number[G_at[chosen, 0]], G_at[chosen, 1]])
    return table[np.argsort(table[:, 1], kind="stable")].astype(np.int64)


class Tables(NamedTuple):
    """The patterns of a problem of K stages, of which R runs of consecutive stages are of one kind each."""

    nx: np.ndarray  # (K,) number of states
    nu: np.ndarray  # (K,) number of controls
    run: np.ndarray  # (K,) which run a stage belongs to
    z_starts: np.ndarray  # (K + 1,) where its variables begin among all
    unequal_starts: np.ndarray  # (K + 1,) where its inequalities begin among all
    H_at: Ragged  # of R parts, as in ``Pattern``
    equal: Ragged  # of R parts
    dense: Ragged  # of R parts
    sparse: Ragged  # of R parts
    dense_rows: Ragged  # of R parts

    @staticmethod
    def of(patterns: Sequence[Pattern], run: np.ndarray, nx: np.ndarray, nu: np.ndarray) -> Tables:
        """Return the tables of a problem.

        Args:
            patterns: of each run.
            run: which run each stage belongs to ``(K,)``.
            nx: number of each stage's states ``(K,)``.
            nu: number of each stage's controls ``(K,)``.
        """
        return Tables(
            nx=nx,
            nu=nu,
            run=run,
            z_starts=starts_of(nx + nu),
            unequal_starts=starts_of([patterns[r].n_unequal for r in run]),
            H_at=Ragged.joined([pattern.H_at for pattern in patterns]),
            equal=Ragged.joined([pattern.equal for pattern in patterns]),
            dense=Ragged.joined([pattern.dense for pattern in patterns]),
            sparse=Ragged.joined([pattern.sparse for pattern in patterns]),
            dense_rows=Ragged.joined([pattern.dense_rows for pattern in patterns]),
        )

    @staticmethod
    def memory(patterns: Sequence[Pattern], run: np.ndarray) -> Derivatives:
        """Return memory for the derivatives of all stages, given the pattern of each run and the run of each stage."""
        return Derivatives(
            F=Ragged.zeros([len(patterns[r].F_at) for r in run]),
            G=Ragged.zeros([patterns[r].n_g for r in run]),
            H=Ragged.zeros([len(patterns[r].H_at) for r in run]),
        )
