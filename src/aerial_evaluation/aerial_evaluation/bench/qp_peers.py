"""Solvers that the controller does not use, on its quadratic programs: what a benchmark compares with.

Whoever is not installed is left out.
"""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from aerial_wbic.force_qp.solvers import INFINITY, QpFactory, QuadraticProgram

_ACCURACY = 1e-6  # of ProxQP's residuals; an active-set method has none
_BOUNDED = 0.1 * INFINITY  # a bound beyond it is none


class Proxqp:
    """ProxQP, a proximal augmented-Lagrangian method, dense; from the solution of the last problem."""

    def __init__(self, program: QuadraticProgram, pattern: np.ndarray | None) -> None:
        from proxsuite import proxqp

        self._program = program
        self._solved = proxqp.PROXQP_SOLVED
        self._qp = proxqp.dense.QP(len(program.f), 0, len(program.upper))
        self._qp.settings.eps_abs = _ACCURACY
        self._qp.settings.compute_timings = False
        self._qp.settings.initial_guess = proxqp.WARM_START_WITH_PREVIOUS_RESULT
        self._begun = False

    def minimum(self) -> np.ndarray | None:
        """Return x ``(3 n,)``; None if ProxQP finds none."""
        problem = self._program
        state = self._qp.update if self._begun else self._qp.init
        state(H=problem.H, g=problem.f, C=problem.A, l=problem.lower, u=problem.upper)
        self._begun = True
        self._qp.solve()
        return self._qp.results.x.copy() if self._qp.results.info.status == self._solved else None


class Quadprog:
    """quadprog, the dual active-set method of Goldfarb and Idnani; every problem from nothing."""

    def __init__(self, program: QuadraticProgram, pattern: np.ndarray | None) -> None:
        import quadprog

        self._program, self._solve = program, quadprog.solve_qp

    def minimum(self) -> np.ndarray | None:
        """Return x ``(3 n,)``; None if quadprog finds none."""
        problem = self._program
        above, below = problem.upper < _BOUNDED, problem.lower > -_BOUNDED
        C = np.vstack([-problem.A[above], problem.A[below]]).T  # Cᵀ x ≥ b
        b = np.concatenate([-problem.upper[above], problem.lower[below]])
        try:
            return self._solve(problem.H, -problem.f, C, b)[0]
        except ValueError:  # inconsistent, or H is not positive
            return None


_PEERS: dict[str, tuple[str, QpFactory]] = {"proxqp": ("proxsuite", Proxqp), "quadprog": ("quadprog", Quadprog)}


def installed() -> dict[str, QpFactory]:
    """Return the peers that are there, by name."""
    return {name: peer for name, (module, peer) in _PEERS.items() if find_spec(module)}


def absent() -> list[str]:
    """Return what to install for the others."""
    return [module for module, _ in _PEERS.values() if not find_spec(module)]
