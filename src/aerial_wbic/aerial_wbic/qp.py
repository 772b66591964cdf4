"""Reaction forces that the ground can give and the base acceleration that follows from them, thesis (3.24).

    min δ_qᵀ Q_1 δ_q + δ_fᵀ Q_2 δ_f
    s.t. S_fb (H q̈ + C q̇ + G) = S_fb J_cᵀ f_r,   q̈ = q̈_cmd + [δ_q; 0],   f_r = f_cmd + δ_f,   W f_r ≥ 0.

OSQP is set up once for every number of loaded points; the sparsity never changes, a tick updates numbers and starts
from the last solution. Its penalty does not adapt to what it met before, so that equal input gives equal output to the
last bit. A fixed penalty converges only on a well scaled problem: the variables are √Q_1 δ_q and √Q_2 δ_f, and the rows of the equations of motion
are multiplied by √Q_1 H_bb⁻¹, so that cost and equality are both of unit size. DAQP, the other solver there is, gets the
same problem without δ_q: the equations of motion give it from δ_f.
"""

from __future__ import annotations

from typing import NamedTuple

import daqp
import numpy as np
import osqp
from scipy import sparse

from aerial_model.compiled import cholesky, cholesky_solve, compiled
from aerial_model.contact import friction_pyramid
from aerial_model.kinematics import Configuration
from aerial_model.robot import BASE_TWIST, JOINT_VELOCITY, Robot
from aerial_wbic.gains import QpSolver

_N_BASE = 6
_LEVER = 0.2  # [m] by which torques are divided, so that their rows are as large as those of forces
_INFINITY = osqp.constant("OSQP_INFTY")
_SETTINGS = {
    "verbose": False,
    "scaling": 0,  # done here
    "adaptive_rho": False,
    "alpha": 1.2,
    "eps_abs": 1e-4,
    "eps_rel": 1e-5,
    "check_termination": 5,
    "warm_starting": True,
    "polishing": False,
}
# Penalties tried in this order, found on recorded jumps and on random problems: the first takes 20 iterations in the
# median and over 70 in 1 % of a jump's ticks, the second solves what is far from what the ground can give.
_USUAL = {"rho": 6.0, "max_iter": 150}
_HARD = {"rho": 100.0, "max_iter": 2500}  # up to 1 ms
_DAQP_SOLVED = 1
_ACCEPTED = (osqp.SolverStatus.OSQP_SOLVED, osqp.SolverStatus.OSQP_SOLVED_INACCURATE)


class Solution(NamedTuple):
    """Acceleration and forces that obey the equations of motion of the base."""

    vdot: np.ndarray  # (nv,) base as physics has it, joints as commanded
    force: np.ndarray  # f_r (n_c, 3) in W [N]; zero where no load is planned
    solved: bool  # False: the fallback's forces


class Room(NamedTuple):
    """Joint torques that the motors can add to what else is asked of them."""

    least: np.ndarray  # (n,) [N·m]
    greatest: np.ndarray  # (n,) [N·m]


class ForceOptimization:
    """The quadratic program of one robot.

    Args:
        robot: gives the number of contacts and the friction coefficient.
        weight_base: Q_1, the same for all six rows.
        weight_force: Q_2, the same for all forces.
        solver: that finds the optimum.
    """

    def __init__(self, robot: Robot, weight_base: float, weight_force: float, solver: QpSolver = QpSolver.OSQP) -> None:
        pyramid = friction_pyramid(robot.friction_coefficient)
        numbers = range(1, robot.n_contacts + 1)
        self._programs = [_Program(n, 0, pyramid, weight_base, weight_force, solver) for n in numbers]
        self._limited = [_Program(n, robot.n_joints, pyramid, weight_base, weight_force, solver) for n in numbers]
        self._friction = float(pyramid[0, 2])

    def solve(self, state: Configuration, vdot_cmd: np.ndarray, f_cmd: np.ndarray, contact: np.ndarray) -> Solution:
        """Return the forces and the acceleration of (3.24).

        When the solver fails, the one fallback is: the commanded forces, moved into the friction pyramid.

        Args:
            state: of the robot.
            vdot_cmd: q̈_cmd ``(nv,)`` of the hierarchy.
            f_cmd: planned forces ``(n_c, 3)`` [N] in W.
            contact: points that carry load ``(n_c,)`` bool.
        """
        n = np.count_nonzero(contact)
        df = self._programs[n - 1].solve(state, vdot_cmd, f_cmd, contact) if n else _NO_FORCE
        solved = df is not None
        force, vdot = _outcome(state, vdot_cmd, f_cmd, contact, df if solved else _NO_FORCE, solved, self._friction)
        return Solution(vdot, force, solved)

    def within(
        self,
        room: Room,
        solution: Solution,
        state: Configuration,
        vdot_cmd: np.ndarray,
        f_cmd: np.ndarray,
        contact: np.ndarray,
    ) -> Solution:
        """Return ``solution`` if the motors have room for its torques, else the solution of (3.24) with limits.

        Limits are those of the limbs that bear load; what no force on them could keep is not asked for. The rest as
        for ``solve``.
        """
        if not contact.any() or not _exceeds(state, solution, room):
            return solution
        df = self._limited[np.count_nonzero(contact) - 1].solve(state, vdot_cmd, f_cmd, contact, room)
        if df is None:
            return solution
        force, vdot = _outcome(state, vdot_cmd, f_cmd, contact, df, True, self._friction)
        return Solution(vdot, force, solution.solved)


_NO_FORCE = np.zeros(0)


class _Program:
    """The problem of ``n`` loaded points and the limits of ``n_limits`` joints, all of them or none.

    Variables: [√Q_1 δ_q (6); √Q_2 δ_f (3 n)]; rows: [equations of motion (6); pyramids (5 n); torques (n_limits)].
    """

    def __init__(
        self, n: int, n_limits: int, pyramid: np.ndarray, weight_base: float, weight_force: float, solver: QpSolver
    ) -> None:
        self._pyramid = pyramid
        self._root_base, self._root_force = float(np.sqrt(weight_base)), float(np.sqrt(weight_force))
        variables, limits = _N_BASE + 3 * n, _N_BASE + len(pyramid) * n
        rows = limits + n_limits
        A = np.zeros((rows, variables))
        A[:_N_BASE, :_N_BASE] = np.eye(_N_BASE)
        A[:_N_BASE, _N_BASE:] = 1.0  # dense: changes with the state
        A[_N_BASE:limits, _N_BASE:] = np.kron(np.eye(n), pyramid) / self._root_force
        A[limits:] = 1.0  # dense: changes with the state
        self._A = sparse.csc_matrix(A)
        column = np.repeat(np.arange(variables), np.diff(self._A.indptr))
        changing = (self._A.indices < _N_BASE) & (column >= _N_BASE)
        self._changing = np.flatnonzero(changing).reshape(3 * n, _N_BASE)  # by column
        self._limits = np.flatnonzero(self._A.indices >= limits).reshape(variables, n_limits)  # by column
        self._lower = np.zeros(rows)
        self._upper = np.full(rows, _INFINITY)
        self._solver = _SOLVERS[solver](self._A, self._lower, self._upper)

    def solve(
        self,
        state: Configuration,
        vdot_cmd: np.ndarray,
        f_cmd: np.ndarray,
        contact: np.ndarray,
        room: Room | None = None,
    ) -> np.ndarray | None:
        """Return δ_f ``(3 n,)`` [N] of the loaded points, or None; ``room`` for one with limits, the rest as of the whole."""
        root_base, root_force = self._root_base, self._root_force
        A, lower, upper = self._A.data, self._lower, self._upper
        _state_problem(
            state, vdot_cmd, f_cmd, contact, self._pyramid, root_base, root_force, self._changing, A, lower, upper
        )
        if room is not None:
            _state_limits(state, vdot_cmd, f_cmd, contact, room, root_base, root_force, self._limits, A, lower, upper)
        x = self._solver.minimum(self._A, lower, upper)
        return None if x is None else x / root_force


class _Osqp:
    """OSQP, set up once for all problems of one sparsity."""

    def __init__(self, A: sparse.csc_matrix, lower: np.ndarray, upper: np.ndarray) -> None:
        rows, variables = A.shape
        self._nothing = np.zeros(variables), np.zeros(rows)
        self._solver = osqp.OSQP()
        P = sparse.eye(variables, format="csc")
        self._solver.setup(P, self._nothing[0], A, lower, upper, **_SETTINGS, **_USUAL)
        self._core = self._solver._solver  # OSQP itself: the wrapper's bookkeeping takes longer than the solution

    def minimum(self, A: sparse.csc_matrix, lower: np.ndarray, upper: np.ndarray) -> np.ndarray | None:
        """Return √Q_2 δ_f; None if OSQP gives up also with the second penalty."""
        self._core.update_data_vec(q=None, l=lower, u=upper)
        self._core.update_data_mat(P_x=None, P_i=None, A_x=A.data, A_i=None)
        x = self._attempt()
        if x is None:
            self._solver.update_settings(**_HARD)
            x = self._attempt()
            self._solver.update_settings(**_USUAL)
        if x is None:
            x, y = self._nothing
            self._solver.warm_start(x=x, y=y)
            return None
        return x[_N_BASE:]

    def _attempt(self) -> np.ndarray | None:
        """Return the variables that OSQP finds; None if it gives up."""
        self._core.solve()
        if self._core.info.status_val not in _ACCEPTED:
            return None
        x = self._core.solution.x
        return x if np.isfinite(x).all() else None


class _Daqp:
    """DAQP, an active-set method, on the problem of the forces alone; every problem from nothing."""

    def __init__(self, A: sparse.csc_matrix, lower: np.ndarray, upper: np.ndarray) -> None:
        self._sense = np.zeros(len(lower) - _N_BASE, dtype=np.int32)  # inequalities

    def minimum(self, A: sparse.csc_matrix, lower: np.ndarray, upper: np.ndarray) -> np.ndarray | None:
        """Return √Q_2 δ_f; None if DAQP finds none, or the problem is not finite."""
        problem = reduced(A.data, A.indices, A.indptr, lower, upper)
        if not np.isfinite(problem.f).all():  # it would not end
            return None
        x, _, status, _ = daqp.solve(*problem, self._sense)
        return x if status == _DAQP_SOLVED and np.isfinite(x).all() else None


_SOLVERS = {QpSolver.OSQP: _Osqp, QpSolver.DAQP: _Daqp}


class Reduced(NamedTuple):
    """min ½ xᵀ H x + fᵀ x  s.t. lower ≤ A x ≤ upper, in the order in which DAQP takes it."""

    H: np.ndarray  # (3 n, 3 n)
    f: np.ndarray  # (3 n,)
    A: np.ndarray  # (m, 3 n)
    upper: np.ndarray  # (m,)
    lower: np.ndarray  # (m,)


@compiled
def reduced(data: np.ndarray, indices: np.ndarray, indptr: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> Reduced:
    """Return the problem of x = √Q_2 δ_f; the first six rows of A say y = √Q_1 δ_q = G x + g.

    Args:
        data: entries of A by columns.
        indices: their rows.
        indptr: where each column begins, and the end.
        lower: least values of A's rows; the first six are equations.
        upper: greatest values.
    """
    rows, n = len(lower) - _N_BASE, len(indptr) - 1 - _N_BASE
    G, A_y = np.zeros((_N_BASE, n)), np.zeros((rows, _N_BASE))
    A, H, f = np.zeros((rows, n)), np.eye(n), np.zeros(n)
    above, below = upper[_N_BASE:].copy(), lower[_N_BASE:].copy()
    for column in range(_N_BASE + n):
        for entry in range(indptr[column], indptr[column + 1]):
            row = indices[entry]
            if column < _N_BASE and row >= _N_BASE:
                A_y[row - _N_BASE, column] = data[entry]
                above[row - _N_BASE] -= data[entry] * lower[column]
                below[row - _N_BASE] -= data[entry] * lower[column]
            elif column >= _N_BASE and row < _N_BASE:
                G[row, column - _N_BASE] = -data[entry]
                f[column - _N_BASE] -= data[entry] * lower[row]
            elif column >= _N_BASE:
                A[row - _N_BASE, column - _N_BASE] = data[entry]
    for i in range(n):
        for j in range(n):
            for k in range(_N_BASE):
                H[i, j] += G[k, i] * G[k, j]
    for row in range(rows):
        for k in range(_N_BASE):
            if A_y[row, k] != 0.0:
                for j in range(n):
                    A[row, j] += A_y[row, k] * G[k, j]
    return Reduced(H, f, A, above, below)


@compiled
def _state_problem(
    state: Configuration,
    vdot_cmd: np.ndarray,
    f_cmd: np.ndarray,
    contact: np.ndarray,
    pyramid: np.ndarray,
    root_base: float,
    root_force: float,
    changing: np.ndarray,
    A: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
) -> None:
    """Write this tick's numbers into the entries ``changing`` ``(3 n, 6)`` of A and into the bounds.

    The rows of the equations of motion say √Q_1 δ_q = √Q_1 H_bb⁻¹ (S_fb J_cᵀ δ_f + what f_cmd leaves missing).
    """
    loaded = np.flatnonzero(contact)
    columns = np.empty((_N_BASE, 3 * len(loaded) + 1))
    for n, i in enumerate(loaded):
        columns[:, 3 * n : 3 * n + 3] = state.J_contacts[i, :, :_N_BASE].T
    columns[:, -1] = _missing(state, vdot_cmd, f_cmd, contact)
    _solve_base(state, columns)
    for column in range(len(changing)):
        for row in range(_N_BASE):
            A[changing[column, row]] = -root_base / root_force * columns[row, column]
    lower[:_N_BASE] = upper[:_N_BASE] = root_base * columns[:, -1]
    rows = len(pyramid)
    for n, i in enumerate(loaded):
        begin = _N_BASE + n * rows
        lower[begin : begin + rows] = -(pyramid @ f_cmd[i])


@compiled
def _state_limits(
    state: Configuration,
    vdot_cmd: np.ndarray,
    f_cmd: np.ndarray,
    contact: np.ndarray,
    room: Room,
    root_base: float,
    root_force: float,
    limits: np.ndarray,
    A: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
) -> None:
    """Write the rows of the torques into the entries ``limits`` ``(6 + 3 n, n)`` of A and into the bounds.

    They say least ≤ τ_cmd + H_jb δ_q − J_jᵀ δ_f ≤ greatest, the bounds moved apart to admit the torques without force.
    """
    loaded = np.flatnonzero(contact)
    n_joints = limits.shape[1]
    begin = len(lower) - n_joints
    force = np.zeros_like(f_cmd)
    free = np.empty((_N_BASE, 1))
    free[:, 0] = _missing(state, vdot_cmd, force, contact)
    _solve_base(state, free)
    for i in loaded:
        force[i] = f_cmd[i]
    torque_cmd = inverse_dynamics(state, Solution(vdot_cmd, force, True))
    for j in range(n_joints):
        row = JOINT_VELOCITY.start + j
        without = state.M[row] @ vdot_cmd + state.nle[row]
        for c in range(_N_BASE):
            A[limits[c, j]] = state.M[row, c] / (_LEVER * root_base)
            without += state.M[row, c] * free[c, 0]
        bears = False
        for n, i in enumerate(loaded):
            for k in range(3):
                slope = state.J_contacts[i, k, row]
                bears |= slope != 0.0
                A[limits[_N_BASE + 3 * n + k, j]] = -slope / (_LEVER * root_force)
        if bears:
            lower[begin + j] = (min(room.least[j], without) - torque_cmd[j]) / _LEVER
            upper[begin + j] = (max(room.greatest[j], without) - torque_cmd[j]) / _LEVER
        else:
            lower[begin + j], upper[begin + j] = -_INFINITY, _INFINITY


@compiled
def _exceeds(state: Configuration, solution: Solution, room: Room) -> bool:
    """Return whether a torque leaves the room."""
    torque = inverse_dynamics(state, solution)
    return bool(np.any(torque < room.least) or np.any(torque > room.greatest))


@compiled
def inverse_dynamics(state: Configuration, solution: Solution) -> np.ndarray:
    """Return the joint torques ``(n,)`` [N·m], the joint rows of H q̈ + C q̇ + G − Σ J_c,iᵀ f_i, thesis (2.2)."""
    torque = state.M[JOINT_VELOCITY] @ solution.vdot + state.nle[JOINT_VELOCITY]
    for i in range(len(solution.force)):
        for k in range(3):
            torque -= solution.force[i, k] * state.J_contacts[i, k, JOINT_VELOCITY]
    return torque


@compiled
def _outcome(
    state: Configuration,
    vdot_cmd: np.ndarray,
    f_cmd: np.ndarray,
    contact: np.ndarray,
    df: np.ndarray,
    solved: bool,
    friction: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return f_r ``(n_c, 3)`` and q̈ ``(nv,)``, the base's part from the forces: the equations of motion hold to rounding."""
    force = np.zeros_like(f_cmd)
    for n, i in enumerate(np.flatnonzero(contact)):
        if solved:
            force[i] = f_cmd[i] + df[3 * n : 3 * n + 3]
        else:
            normal = max(f_cmd[i, 2], 0.0)
            side = friction * normal
            force[i, 0] = min(max(f_cmd[i, 0], -side), side)
            force[i, 1] = min(max(f_cmd[i, 1], -side), side)
            force[i, 2] = normal
    change = np.empty((_N_BASE, 1))
    change[:, 0] = _missing(state, vdot_cmd, force, contact)
    _solve_base(state, change)
    vdot = vdot_cmd.copy()
    vdot[BASE_TWIST] += change[:, 0]
    return force, vdot


@compiled
def _solve_base(state: Configuration, columns: np.ndarray) -> None:
    """Replace columns ``(6, k)`` by H_bb⁻¹ times them."""
    L = np.empty((_N_BASE, _N_BASE))
    cholesky(state.M[BASE_TWIST, BASE_TWIST], L)
    cholesky_solve(L, columns)


@compiled
def _missing(state: Configuration, vdot_cmd: np.ndarray, force: np.ndarray, contact: np.ndarray) -> np.ndarray:
    """Return S_fb (J_cᵀ f − H q̈_cmd − C q̇ − G) ``(6,)`` with the forces of the loaded points."""
    wrench = -(state.M[BASE_TWIST] @ vdot_cmd) - state.nle[BASE_TWIST]
    for i in np.flatnonzero(contact):
        for k in range(3):
            wrench += force[i, k] * state.J_contacts[i, k, BASE_TWIST]
    return wrench
