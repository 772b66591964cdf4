"""Solvers of the controller's quadratic program, all of which take it in the same form."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import daqp
import numpy as np
import osqp
from scipy import sparse

from aerial_model.numerics.layout import Layout
from aerial_wbic.force_qp.contact_acceleration import N_BASE
from aerial_wbic.gains import QpSolver

INFINITY = osqp.constant("OSQP_INFTY")
_SETTINGS = {
    "verbose": False,
    "scaling": 0,  # done here
    "adaptive_rho": False,
    "alpha": 1.0,  # without over-relaxation a step is exact as long as no face of a pyramid is met
    "eps_abs": 1e-5,
    "eps_rel": 1e-6,
    "check_termination": 3,
    "warm_starting": True,
    "polishing": False,
}
# The penalty was found on recorded motions: a quadruped's jump, roll and flips take 3 iterations in the median and at the
# 99th percentile, a humanoid's jump, spin and flip 9 in the median. What is far from what the ground can give takes hundreds;
# an active-set method is faster there.
_PENALTY = {"rho": 0.1, "max_iter": 60}
_DAQP_SOLVED = 1
_ACCEPTED = (osqp.SolverStatus.OSQP_SOLVED, osqp.SolverStatus.OSQP_SOLVED_INACCURATE)


class QuadraticProgram(NamedTuple):
    """min ½ xᵀ H x + fᵀ x  s.t. lower ≤ A x ≤ upper, with x = √Q_2 δ_f; all of it lies in one block and changes in place."""

    H: np.ndarray  # (3 n, 3 n)
    triangle: np.ndarray  # its upper triangle, column by column
    f: np.ndarray  # (3 n,)
    A: np.ndarray  # (m, 3 n)
    lower: np.ndarray  # (m,)
    upper: np.ndarray  # (m,)
    G: np.ndarray  # (6, 3 n) of the base's acceleration, √Q_1 δ_q = G x + g
    g: np.ndarray  # (6,)
    root_base: float  # √Q_1
    root_force: float  # √Q_2
    block: np.ndarray  # what all of it lies in


PROGRAM = Layout(
    sizes=("n", "m"),  # variables, rows
    numbers=("root_base", "root_force"),
    arrays={
        "H": ("n", "n"),
        "triangle": ("n * (n + 1) // 2",),
        "f": ("n",),
        "A": ("m", "n"),
        "lower": ("m",),
        "upper": ("m",),
        "G": (N_BASE, "n"),
        "g": (N_BASE,),
    },
)
program_in = PROGRAM.reader(QuadraticProgram)


def blank_program(n: int, m: int, root_base: float, root_force: float) -> QuadraticProgram:
    """Return the memory of a program of n variables and m rows."""
    return program_in(PROGRAM.block(n=n, m=m, root_base=root_base, root_force=root_force))


class QpMinimizer(Protocol):
    """What solves the problems that one program is to state."""

    def minimum(self) -> np.ndarray | None:
        """Return x ``(3 n,)`` at the optimum of the program as it is; None if none is found."""


QpFactory = Callable[[QuadraticProgram, np.ndarray | None], QpMinimizer]
# Of a program, and of which entries of A ``(m, 3 n)`` bool change and are not zero; None: none ever changes.


class Osqp:
    """OSQP, set up once for all problems of one sparsity; each starts from the solution of the last.

    Its penalty does not adapt to what it met before, so that equal input gives equal output to the last bit. What it has
    not solved in time is left to DAQP.
    """

    def __init__(self, program: QuadraticProgram, pattern: np.ndarray | None) -> None:
        n, m = len(program.f), len(program.lower)
        self._program = program
        self._nothing = np.zeros(n), np.zeros(m)
        self._solver = osqp.OSQP()
        A = sparse.csc_matrix(program.A if pattern is None else pattern | (program.A != 0))
        self._entries = None if pattern is None else (A.indices, np.repeat(np.arange(n), np.diff(A.indptr)))
        P = sparse.csc_matrix(np.triu(np.ones((n, n))))
        self._solver.setup(P, program.f, A.astype(float), program.lower, program.upper, **_SETTINGS, **_PENALTY)
        self._second = Daqp(program, pattern)
        self._core = self._solver._solver  # OSQP itself: the wrapper's bookkeeping takes longer than the solution

    def minimum(self) -> np.ndarray | None:
        """Return √Q_2 δ_f; None if DAQP, the second to try, finds none either."""
        program = self._program
        A = None if self._entries is None else program.A[self._entries]
        self._core.update_data_vec(q=program.f, l=program.lower, u=program.upper)
        self._core.update_data_mat(P_x=program.triangle, P_i=None, A_x=A, A_i=None)
        x = self._attempt()
        if x is not None:
            return x
        x, y = self._nothing
        self._solver.warm_start(x=x, y=y)
        return self._second.minimum()

    def _attempt(self) -> np.ndarray | None:
        """Return the variables that OSQP finds; None if it gives up."""
        self._core.solve()
        return self._core.solution.x if self._core.info.status_val in _ACCEPTED else None


class Daqp:
    """DAQP, an active-set method; every problem from nothing."""

    def __init__(self, program: QuadraticProgram, pattern: np.ndarray | None) -> None:
        inequalities = np.zeros(len(program.lower), dtype=np.int32)
        self._problem = program.H, program.f, program.A, program.upper, program.lower, inequalities

    def minimum(self) -> np.ndarray | None:
        """Return √Q_2 δ_f; None if DAQP finds none."""
        x, _, status, _ = daqp.solve(*self._problem)
        return x if status == _DAQP_SOLVED else None


SOLVERS: dict[QpSolver, QpFactory] = {QpSolver.OSQP: Osqp, QpSolver.DAQP: Daqp}
