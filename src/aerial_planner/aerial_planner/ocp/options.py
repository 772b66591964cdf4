"""Options and results that all solvers of multi-stage problems share."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np


class SolverName(StrEnum):
    """Solvers to choose from; each is a primal-dual interior-point method with a filter."""

    RICCATI = "riccati"  # our own (interior_point, riccati)
    FATROP = "fatrop"  # the method ours follows, on BLASFEO
    IPOPT = "ipopt"  # with MUMPS, which knows nothing of stages


@dataclass(frozen=True, kw_only=True)
class SolverOptions:
    """How to solve a problem; the defaults suit a good first guess."""

    solver: str = SolverName.RICCATI
    tolerance: float = 1e-4  # on the scaled optimality conditions (5) of Wächter and Biegler (2006)
    max_iterations: int = 100
    initial_barrier: float = 1.0  # μ_0 of the interior-point method: high, where the guess is outside of the limits
    barrier_accuracy: float = 100.0  # how far a barrier problem is solved before the next, in multiples of μ
    bound_distance: float = 0.3  # of the guess from its bounds, as a share of their range (or of 1, if smaller)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Where a solver ended, and why."""

    w: np.ndarray  # (n_w,) variables of all stages
    cost: float
    iterations: int
    status: str
    converged: bool
