"""Reaction forces that the ground can give and the base acceleration that follows from them, thesis (3.24).

    min δ_qᵀ Q_1 δ_q + δ_fᵀ Q_2 δ_f
    s.t. S_fb (H q̈ + C q̇ + G) = S_fb J_cᵀ f_r,   q̈ = q̈_cmd + E δ_q,   f_r = f_cmd + δ_f,   W f_r ≥ 0.

In the thesis E = [1; 0]: the base gives way, the joints accelerate as commanded, and feet that the ground holds would have
to slip. Here the joints give way with the base: E δ_q is the motion with that acceleration of the base in which loaded
points stay where they are, and of these the one of least kinetic energy of the joints. The forces are then those that the
ground really gives, and the torques those that go with them.

A solver is set up once for every number of loaded points; the sparsity never changes, a tick updates numbers. The problem
is scaled, as a fixed penalty needs it to converge: the variables are √Q_1 δ_q and √Q_2 δ_f, and the rows of the equations
of motion are multiplied by √Q_1 (S_fb H E)⁻¹, so that cost and equality are both of unit size.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from aerial_model.compiled import cholesky, cholesky_solve, compiled, invert
from aerial_model.contact import friction_pyramid
from aerial_model.kinematics import Configuration
from aerial_model.robot import BASE_TWIST, JOINT_VELOCITY, Robot
from aerial_wbic.qp_solvers import INFINITY, N_BASE, Osqp, QpFactory

_HELD = 1e-6  # [1/kg] below it no joint holds a direction of a point: straight legs, points of one foot
_LEVER = 0.2  # [m] by which torques are divided, so that their rows are as large as those of forces


class Solution(NamedTuple):
    """Acceleration, forces and torques that obey the equations of motion."""

    vdot: np.ndarray  # (nv,) as physics has it
    force: np.ndarray  # f_r (n_c, 3) in W [N]; zero where no load is planned
    torque: np.ndarray  # of the joints (n,) [N·m], thesis (2.2)
    solved: bool  # False: the fallback's forces


class Room(NamedTuple):
    """Joint torques that the motors can add to what else is asked of them."""

    least: np.ndarray  # (n,) [N·m]
    greatest: np.ndarray  # (n,) [N·m]


class GiveWay(NamedTuple):
    """How the robot gives way where the commanded accelerations and the forces do not fit."""

    E: np.ndarray  # (nv, 6) accelerations with that of the base, loaded points at rest
    inverse: np.ndarray  # (S_fb H E)⁻¹ (6, 6): the base's acceleration for a wrench that is missing


class ForceOptimization:
    """The quadratic program of one robot.

    Args:
        robot: gives the number of contacts and the friction coefficient.
        weight_base: Q_1, the same for all six rows.
        weight_force: Q_2, the same for all forces.
        solver: makes what finds the optimum.
    """

    def __init__(self, robot: Robot, weight_base: float, weight_force: float, solver: QpFactory = Osqp) -> None:
        pyramid = friction_pyramid(robot.friction_coefficient)
        numbers = range(1, robot.n_contacts + 1)
        self._programs = [_Program(n, 0, pyramid, weight_base, weight_force, solver) for n in numbers]
        self._limited = [_Program(n, robot.n_joints, pyramid, weight_base, weight_force, solver) for n in numbers]
        self._friction = float(pyramid[0, 2])
        self._root_force = float(np.sqrt(weight_force))
        # Of this tick; written in place.
        self._give = GiveWay(np.zeros((robot.model.nv, N_BASE)), np.zeros((N_BASE, N_BASE)))

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
        df = self._programs[n - 1].solve(state, vdot_cmd, f_cmd, contact, self._give) if n else _NO_FORCE
        return self._solution(state, vdot_cmd, f_cmd, contact, df)

    def within(
        self,
        room: Room,
        solution: Solution,
        state: Configuration,
        vdot_cmd: np.ndarray,
        f_cmd: np.ndarray,
        contact: np.ndarray,
    ) -> Solution:
        """Return the solution of (3.24) with limits, or the given one of ``solve`` when there is none.

        Limits are those of the limbs that bear load, one at least; what no force on them could keep is not asked for. The
        rest as for ``solve``.
        """
        program = self._limited[np.count_nonzero(contact) - 1]
        df = program.solve(state, vdot_cmd, f_cmd, contact, self._give, room)
        limited = self._solution(state, vdot_cmd, f_cmd, contact, df)
        return limited._replace(solved=solution.solved) if limited.solved else solution

    def _solution(
        self, state: Configuration, vdot_cmd: np.ndarray, f_cmd: np.ndarray, contact: np.ndarray, df: np.ndarray | None
    ) -> Solution:
        """Return what follows from the optimum; with None, or what is not finite, the fallback."""
        found = _NO_FORCE if df is None else df
        solved = df is not None
        return Solution(
            *_outcome(state, vdot_cmd, f_cmd, contact, self._give, found, solved, self._root_force, self._friction)
        )


_NO_FORCE = np.zeros(0)


class _Program:
    """The problem of ``n`` loaded points and the limits of ``n_limits`` joints, all of them or none.

    Variables: [√Q_1 δ_q (6); √Q_2 δ_f (3 n)]; rows: [equations of motion (6); pyramids (5 n); torques (n_limits)].
    """

    def __init__(
        self, n: int, n_limits: int, pyramid: np.ndarray, weight_base: float, weight_force: float, solver: QpFactory
    ) -> None:
        self._pyramid = pyramid
        self._root_base, self._root_force = float(np.sqrt(weight_base)), float(np.sqrt(weight_force))
        variables, limits = N_BASE + 3 * n, N_BASE + len(pyramid) * n
        rows = limits + n_limits
        A = np.zeros((rows, variables))
        A[:N_BASE, :N_BASE] = np.eye(N_BASE)
        A[:N_BASE, N_BASE:] = 1.0  # dense: changes with the state
        A[N_BASE:limits, N_BASE:] = np.kron(np.eye(n), pyramid) / self._root_force
        A[limits:] = 1.0  # dense: changes with the state
        self._A = sparse.csc_matrix(A)
        column = np.repeat(np.arange(variables), np.diff(self._A.indptr))
        changing = (self._A.indices < N_BASE) & (column >= N_BASE)
        self._changing = np.flatnonzero(changing).reshape(3 * n, N_BASE)  # by column
        self._limits = np.flatnonzero(self._A.indices >= limits).reshape(variables, n_limits)  # by column
        self._lower = np.zeros(rows)
        self._upper = np.full(rows, INFINITY)
        self._solver = solver(self._A, self._lower, self._upper)

    def solve(
        self,
        state: Configuration,
        vdot_cmd: np.ndarray,
        f_cmd: np.ndarray,
        contact: np.ndarray,
        give: GiveWay,
        room: Room | None = None,
    ) -> np.ndarray | None:
        """Return √Q_2 δ_f ``(3 n,)`` of the loaded points, or None; ``room`` for one with limits, the rest as of the whole."""
        root_base, root_force = self._root_base, self._root_force
        A, lower, upper = self._A.data, self._lower, self._upper
        _state_problem(
            state, vdot_cmd, f_cmd, contact, give, self._pyramid, root_base, root_force, self._changing, A, lower, upper
        )
        if room is not None:
            _state_limits(
                state, vdot_cmd, f_cmd, contact, give, room, root_base, root_force, self._limits, A, lower, upper
            )
        return self._solver.minimum(self._A, lower, upper)


@compiled
def _state_problem(
    state: Configuration,
    vdot_cmd: np.ndarray,
    f_cmd: np.ndarray,
    contact: np.ndarray,
    give: GiveWay,
    pyramid: np.ndarray,
    root_base: float,
    root_force: float,
    changing: np.ndarray,
    A: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
) -> None:
    """Write this tick's numbers into the entries ``changing`` ``(3 n, 6)`` of A, into the bounds and into ``give``.

    The rows of the equations of motion say √Q_1 δ_q = √Q_1 (S_fb H E)⁻¹ (S_fb J_cᵀ δ_f + what f_cmd leaves missing).
    """
    give_way(state, contact, give)
    loaded = np.flatnonzero(contact)
    columns = np.empty((N_BASE, 3 * len(loaded) + 1))
    for n, i in enumerate(loaded):
        columns[:, 3 * n : 3 * n + 3] = state.J_contacts[i, :, :N_BASE].T
    columns[:, -1] = _missing(state, vdot_cmd, f_cmd, contact)
    columns = give.inverse @ columns
    for column in range(len(changing)):
        for row in range(N_BASE):
            A[changing[column, row]] = -root_base / root_force * columns[row, column]
    lower[:N_BASE] = upper[:N_BASE] = root_base * columns[:, -1]
    rows = len(pyramid)
    for n, i in enumerate(loaded):
        begin = N_BASE + n * rows
        lower[begin : begin + rows] = -(pyramid @ f_cmd[i])


@compiled
def _state_limits(
    state: Configuration,
    vdot_cmd: np.ndarray,
    f_cmd: np.ndarray,
    contact: np.ndarray,
    give: GiveWay,
    room: Room,
    root_base: float,
    root_force: float,
    limits: np.ndarray,
    A: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
) -> None:
    """Write the rows of the torques into the entries ``limits`` ``(6 + 3 n, n)`` of A and into the bounds.

    They say least ≤ τ_cmd + H_j E δ_q − J_jᵀ δ_f ≤ greatest, the bounds moved apart to admit the torques without force.
    """
    loaded = np.flatnonzero(contact)
    n_joints = limits.shape[1]
    begin = len(lower) - n_joints
    force = np.zeros_like(f_cmd)
    H_E = state.M @ give.E
    free = give.inverse @ _missing(state, vdot_cmd, force, contact)
    for i in loaded:
        force[i] = f_cmd[i]
    torque_cmd = _inverse_dynamics(state, vdot_cmd, force)
    for j in range(n_joints):
        row = JOINT_VELOCITY.start + j
        without = state.M[row] @ vdot_cmd + state.nle[row]
        for c in range(N_BASE):
            A[limits[c, j]] = H_E[row, c] / (_LEVER * root_base)
            without += H_E[row, c] * free[c]
        bears = False
        for n, i in enumerate(loaded):
            for k in range(3):
                slope = state.J_contacts[i, k, row]
                bears |= slope != 0.0
                A[limits[N_BASE + 3 * n + k, j]] = -slope / (_LEVER * root_force)
        if bears:
            lower[begin + j] = (min(room.least[j], without) - torque_cmd[j]) / _LEVER
            upper[begin + j] = (max(room.greatest[j], without) - torque_cmd[j]) / _LEVER
        else:
            lower[begin + j], upper[begin + j] = -INFINITY, INFINITY


@compiled
def _inverse_dynamics(state: Configuration, vdot: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return the joint torques ``(n,)`` [N·m], the joint rows of H q̈ + C q̇ + G − Σ J_c,iᵀ f_i, thesis (2.2)."""
    torque = state.M[JOINT_VELOCITY] @ vdot + state.nle[JOINT_VELOCITY]
    for i in range(len(force)):
        for k in range(3):
            torque -= force[i, k] * state.J_contacts[i, k, JOINT_VELOCITY]
    return torque


@compiled
def _outcome(
    state: Configuration,
    vdot_cmd: np.ndarray,
    f_cmd: np.ndarray,
    contact: np.ndarray,
    give: GiveWay,
    df: np.ndarray,
    solved: bool,
    root_force: float,
    friction: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """Return q̈ ``(nv,)``, f_r ``(n_c, 3)``, τ ``(n,)``, and whether they follow from √Q_2 δ_f, which is ``df``.

    How the robot gives way follows from the forces: the equations of motion hold to rounding.
    """
    force = np.zeros_like(f_cmd)
    for k in range(len(df)):
        solved = solved and np.isfinite(df[k])
    for n, i in enumerate(np.flatnonzero(contact)):
        if solved:
            force[i] = f_cmd[i] + df[3 * n : 3 * n + 3] / root_force
        else:
            normal = max(f_cmd[i, 2], 0.0)
            side = friction * normal
            force[i, 0] = min(max(f_cmd[i, 0], -side), side)
            force[i, 1] = min(max(f_cmd[i, 1], -side), side)
            force[i, 2] = normal
    if not contact.any():
        give_way(state, contact, give)
    vdot = vdot_cmd + give.E @ (give.inverse @ _missing(state, vdot_cmd, force, contact))
    return vdot, force, _inverse_dynamics(state, vdot, force), solved


@compiled
def give_way(state: Configuration, contact: np.ndarray, give: GiveWay) -> None:
    """Write how the robot gives way while the points of ``contact`` ``(n_c,)`` bool stay at rest.

    The joints' part of E is −H_jj⁻¹ J_jᵀ (J_j H_jj⁻¹ J_jᵀ)⁻¹ J_b; without contact it is zero.
    """
    E = give.E
    E[:] = 0.0
    for k in range(N_BASE):
        E[k, k] = 1.0
    loaded = np.flatnonzero(contact)
    if len(loaded) > 0:
        rows, n = 3 * len(loaded), len(E) - N_BASE
        J_b, J_j = np.empty((rows, N_BASE)), np.empty((rows, n))
        for i, point in enumerate(loaded):
            J_b[3 * i : 3 * i + 3] = state.J_contacts[point, :, BASE_TWIST]
            J_j[3 * i : 3 * i + 3] = state.J_contacts[point, :, JOINT_VELOCITY]
        L = np.empty((n, n))
        cholesky(state.M[JOINT_VELOCITY, JOINT_VELOCITY], L)
        moved = np.ascontiguousarray(J_j.T)
        cholesky_solve(L, moved)
        A = J_j @ moved
        for k in range(rows):
            A[k, k] += _HELD
        L = np.empty_like(A)
        cholesky(A, L)
        cholesky_solve(L, J_b)
        E[JOINT_VELOCITY] = -(moved @ J_b)
    invert(np.ascontiguousarray(state.M[BASE_TWIST]) @ E, give.inverse)


@compiled
def _missing(state: Configuration, vdot_cmd: np.ndarray, force: np.ndarray, contact: np.ndarray) -> np.ndarray:
    """Return S_fb (J_cᵀ f − H q̈_cmd − C q̇ − G) ``(6,)`` with the forces of the loaded points."""
    wrench = -(state.M[BASE_TWIST] @ vdot_cmd) - state.nle[BASE_TWIST]
    for i in np.flatnonzero(contact):
        for k in range(3):
            wrench += force[i, k] * state.J_contacts[i, k, BASE_TWIST]
    return wrench
