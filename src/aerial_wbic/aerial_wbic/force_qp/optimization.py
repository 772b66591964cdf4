"""Reaction forces that the ground can give and the base acceleration that follows from them, thesis (3.24).

    min δ_qᵀ Q_1 δ_q + δ_fᵀ Q_2 δ_f
    s.t. S_fb (H q̈ + C q̇ + G) = S_fb J_cᵀ f_r,   q̈ = q̈_cmd + E δ_q,   f_r = f_cmd + δ_f,   W f_r ≥ 0.

In the thesis E = [1; 0]: the base gives way, the joints accelerate as commanded, and feet that the ground holds would have
to slip. Here the joints give way with the base: E δ_q is the motion with that acceleration of the base in which loaded
points stay where they are, and of these the one of least kinetic energy of the joints. The forces are then those that the
ground really gives, and the torques those that go with them.

The equations of motion of the base give δ_q for any δ_f, so the forces are the only variables; they are scaled, x = √Q_2 δ_f,
as a fixed penalty needs it to converge. A solver is set up once for every number of loaded points; the sparsity never
changes, a tick updates numbers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.kinematics import Configuration, configuration_in
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.layout import cut, cut_rows
from aerial_model.robot.contact import friction_pyramid
from aerial_model.robot.robot import JOINT_VELOCITY, Robot
from aerial_wbic.force_qp.contact_acceleration import N_BASE, GiveWay, blank_give_way, give_way, give_way_in
from aerial_wbic.force_qp.solvers import INFINITY, Osqp, QpFactory, blank_program, program_in

_FACES = 5  # of a pyramid
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


class _Answer(NamedTuple):
    """Where a solution is written; all of it lies in one block."""

    vdot: np.ndarray  # as of Solution
    force: np.ndarray
    torque: np.ndarray
    block: np.ndarray  # what all these arrays lie in


@compiled
def _answer_in(block: np.ndarray, nv: int) -> _Answer:
    n = nv - N_BASE
    vdot, at = cut(block, 0, nv)
    torque, at = cut(block, at, n)
    force, at = cut_rows(block, at, (len(block) - at) // 3, 3)
    return _Answer(vdot, force, torque, block)


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
        nv = robot.model.nv
        self._give = blank_give_way(nv)
        blocks = np.zeros((2, nv + robot.n_joints + 3 * robot.n_contacts))
        self._free_answer, self._limited_answer = (_answer_in(block, nv) for block in blocks)

    def solve(self, state: Configuration, vdot_cmd: np.ndarray, f_cmd: np.ndarray, contact: np.ndarray) -> Solution:
        """Return the forces and the acceleration of (3.24), which hold until the next are asked for.

        When the solver fails, the one fallback is: the commanded forces, moved into the friction pyramid.

        Args:
            state: of the robot.
            vdot_cmd: q̈_cmd ``(nv,)`` of the hierarchy.
            f_cmd: planned forces ``(n_c, 3)`` [N] in W.
            contact: points that carry load ``(n_c,)`` bool.
        """
        n = np.count_nonzero(contact)
        df = self._programs[n - 1].solve(state, vdot_cmd, f_cmd, contact, self._give) if n else _NO_FORCE
        return self._solution(self._free_answer, state, vdot_cmd, f_cmd, contact, df)

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
        limited = self._solution(self._limited_answer, state, vdot_cmd, f_cmd, contact, df)
        return limited._replace(solved=solution.solved) if limited.solved else solution

    def _solution(
        self,
        answer: _Answer,
        state: Configuration,
        vdot_cmd: np.ndarray,
        f_cmd: np.ndarray,
        contact: np.ndarray,
        df: np.ndarray | None,
    ) -> Solution:
        """Return what follows from the optimum; with None, or what is not finite, the fallback."""
        found, solved = (_NO_FORCE, False) if df is None else (df, True)
        solved = _answer(
            state.block,
            vdot_cmd,
            f_cmd,
            contact,
            self._give.block,
            found,
            solved,
            self._root_force,
            self._friction,
            answer.block,
        )
        return Solution(answer.vdot, answer.force, answer.torque, solved)


_NO_FORCE = np.zeros(0)


class _Program:
    """The problem of ``n`` loaded points and the limits of ``n_limits`` joints, all of them or none.

    Rows: [pyramids (5 n); torques (n_limits)].
    """

    def __init__(
        self, n: int, n_limits: int, pyramid: np.ndarray, weight_base: float, weight_force: float, solver: QpFactory
    ) -> None:
        root_base, root_force = float(np.sqrt(weight_base)), float(np.sqrt(weight_force))
        faces = _FACES * n
        self._program = program = blank_program(3 * n, faces + n_limits, root_base, root_force)
        program.A[:faces] = np.kron(np.eye(n), pyramid) / root_force
        program.upper[:] = INFINITY
        limits = np.zeros_like(program.A, dtype=bool)
        limits[faces:] = True
        self._solver = solver(program, limits if n_limits else None)

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
        wish = state.block, vdot_cmd, f_cmd, contact, give.block
        if not _state_problem(*wish, self._program.block):  # a solver might not end
            return None
        if room is not None:
            _state_limits(*wish, room, self._program.block)
        return self._solver.minimum()


@compiled
def _state_problem(
    state_block: np.ndarray,
    vdot_cmd: np.ndarray,
    f_cmd: np.ndarray,
    contact: np.ndarray,
    give_block: np.ndarray,
    program_block: np.ndarray,
) -> bool:
    """Write this tick's numbers into a program and into ``give``; return whether they are finite.

    The equations of motion say √Q_1 δ_q = √Q_1 (S_fb H E)⁻¹ (S_fb J_cᵀ δ_f + what f_cmd leaves missing) = G x + g.
    """
    state, give, program = configuration_in(state_block), give_way_in(give_block), program_in(program_block)
    H, f, A, G, g = program.H, program.f, program.A, program.G, program.g
    give_way(state, contact, give)
    missing = _missing(state, vdot_cmd, f_cmd, contact)
    for row in range(N_BASE):
        g[row] = 0.0
        for k in range(N_BASE):
            g[row] += program.root_base * give.inverse[row, k] * missing[k]
    scale, n = program.root_base / program.root_force, 0
    for i in range(len(contact)):
        if not contact[i]:
            continue
        for axis in range(3):
            for row in range(N_BASE):
                lift = 0.0
                for k in range(N_BASE):
                    lift += give.inverse[row, k] * state.J_contacts[i, axis, k]
                G[row, 3 * n + axis] = scale * lift
        for face in range(_FACES * n, _FACES * (n + 1)):
            inside = 0.0
            for axis in range(3):
                inside += A[face, 3 * n + axis] * f_cmd[i, axis]
            program.lower[face] = -program.root_force * inside
        n += 1
    at, finite = 0, True
    for j in range(len(f)):
        f[j] = 0.0
        for k in range(N_BASE):
            f[j] += G[k, j] * g[k]
        finite = finite and np.isfinite(f[j])
        for i in range(j + 1):
            inner = 1.0 if i == j else 0.0
            for k in range(N_BASE):
                inner += G[k, i] * G[k, j]
            H[i, j] = H[j, i] = program.triangle[at] = inner
            at += 1
    return finite


@compiled
def _state_limits(
    state_block: np.ndarray,
    vdot_cmd: np.ndarray,
    f_cmd: np.ndarray,
    contact: np.ndarray,
    give_block: np.ndarray,
    room: Room,
    program_block: np.ndarray,
) -> None:
    """Write the rows of the torques into a program of which the rest is written.

    They say least ≤ τ_cmd + H_j E δ_q − J_jᵀ δ_f ≤ greatest, the bounds moved apart to admit the torques without force.
    """
    state, give, program = configuration_in(state_block), give_way_in(give_block), program_in(program_block)
    A, lower, upper = program.A, program.lower, program.upper
    loaded, n_joints = np.flatnonzero(contact), len(room.least)
    begin = len(lower) - n_joints
    force, torque_cmd = np.zeros_like(f_cmd), np.empty(n_joints)
    H_E = state.M @ give.E
    free = give.inverse @ _missing(state, vdot_cmd, force, contact)
    for i in loaded:
        force[i] = f_cmd[i]
    _inverse_dynamics(state, vdot_cmd, force, torque_cmd)
    for j in range(n_joints):
        row = JOINT_VELOCITY.start + j
        without, missing = state.nle[row], 0.0
        for k in range(len(vdot_cmd)):
            without += state.M[row, k] * vdot_cmd[k]
        A[begin + j] = 0.0
        for c in range(N_BASE):
            without += H_E[row, c] * free[c]
            missing += H_E[row, c] * program.g[c] / program.root_base
            for k in range(A.shape[1]):
                A[begin + j, k] += H_E[row, c] * program.G[c, k] / (_LEVER * program.root_base)
        bears = False
        for n, i in enumerate(loaded):
            for k in range(3):
                slope = state.J_contacts[i, k, row]
                bears |= slope != 0.0
                A[begin + j, 3 * n + k] -= slope / (_LEVER * program.root_force)
        if bears:
            lower[begin + j] = (min(room.least[j], without) - torque_cmd[j] - missing) / _LEVER
            upper[begin + j] = (max(room.greatest[j], without) - torque_cmd[j] - missing) / _LEVER
        else:
            lower[begin + j], upper[begin + j] = -INFINITY, INFINITY


@compiled
def _inverse_dynamics(state: Configuration, vdot: np.ndarray, force: np.ndarray, torque: np.ndarray) -> None:
    """Write the joint torques ``(n,)`` [N·m], the joint rows of H q̈ + C q̇ + G − Σ J_c,iᵀ f_i, thesis (2.2)."""
    for j in range(len(torque)):
        row = JOINT_VELOCITY.start + j
        torque[j] = state.nle[row]
        for k in range(len(vdot)):
            torque[j] += state.M[row, k] * vdot[k]
        for i in range(len(force)):
            for axis in range(3):
                torque[j] -= force[i, axis] * state.J_contacts[i, axis, row]


@compiled
def _answer(
    state_block: np.ndarray,
    vdot_cmd: np.ndarray,
    f_cmd: np.ndarray,
    contact: np.ndarray,
    give_block: np.ndarray,
    df: np.ndarray,
    solved: bool,
    root_force: float,
    friction: float,
    answer_block: np.ndarray,
) -> bool:
    """Write q̈, f_r and τ; return whether they follow from √Q_2 δ_f, which is ``df``.

    How the robot gives way follows from the forces: the equations of motion hold to rounding.
    """
    state, give = configuration_in(state_block), give_way_in(give_block)
    answer = _answer_in(answer_block, len(vdot_cmd))
    vdot, force = answer.vdot, answer.force
    for k in range(len(df)):
        solved = solved and np.isfinite(df[k])
    n = 0
    for i in range(len(contact)):
        if not contact[i]:
            force[i] = 0.0
        elif solved:
            for axis in range(3):
                force[i, axis] = f_cmd[i, axis] + df[3 * n + axis] / root_force
        else:
            normal = max(f_cmd[i, 2], 0.0)
            side = friction * normal
            force[i, 0] = min(max(f_cmd[i, 0], -side), side)
            force[i, 1] = min(max(f_cmd[i, 1], -side), side)
            force[i, 2] = normal
        n += contact[i]
    if n == 0:
        give_way(state, contact, give)
    missing = _missing(state, vdot_cmd, force, contact)
    for i in range(len(vdot)):
        vdot[i] = vdot_cmd[i]
    for c in range(N_BASE):
        given = 0.0
        for k in range(N_BASE):
            given += give.inverse[c, k] * missing[k]
        for i in range(len(vdot)):
            vdot[i] += give.E[i, c] * given
    _inverse_dynamics(state, vdot, force, answer.torque)
    return solved


@compiled
def _missing(state: Configuration, vdot_cmd: np.ndarray, force: np.ndarray, contact: np.ndarray) -> np.ndarray:
    """Return S_fb (J_cᵀ f − H q̈_cmd − C q̇ − G) ``(6,)`` with the forces of the loaded points."""
    wrench = np.empty(N_BASE)
    for row in range(N_BASE):
        wrench[row] = -state.nle[row]
        for k in range(len(vdot_cmd)):
            wrench[row] -= state.M[row, k] * vdot_cmd[k]
        for i in range(len(contact)):
            if contact[i]:
                for axis in range(3):
                    wrench[row] += force[i, axis] * state.J_contacts[i, axis, row]
    return wrench
