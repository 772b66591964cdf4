"""What a tick writes into its quadratic program, and what follows from the optimum: thesis (3.24) in numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.kinematics import Configuration, configuration_in
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.layout import Layout
from aerial_model.robot.robot import JOINT_VELOCITY
from aerial_wbic.force_qp.contact_acceleration import (
    N_BASE,
    ContactAcceleration,
    contact_acceleration_in,
    write_contact_acceleration,
)
from aerial_wbic.force_qp.solvers import INFINITY, QuadraticProgram, program_in

FACES = 5  # of a friction pyramid
_LEVER = 0.2  # [m] by which torques are divided, so that their rows are as large as those of forces


class TorqueHeadroom(NamedTuple):
    """Joint torques that the motors can add to what else is asked of them."""

    least: np.ndarray  # (n,) [N·m]
    greatest: np.ndarray  # (n,) [N·m]


class SolutionMemory(NamedTuple):
    """Where a solution is written; all of it lies in one block."""

    vdot: np.ndarray  # q̈ (nv,)
    torque: np.ndarray  # (n,) [N·m]
    force: np.ndarray  # f_r (n_c, 3) [N]
    block: np.ndarray  # what all these arrays lie in


SOLUTION = Layout(sizes=("n", "n_c"), arrays={"vdot": ("6 + n",), "torque": ("n",), "force": ("n_c", 3)})
solution_in = SOLUTION.reader(SolutionMemory)


@compiled
def write_program(
    state_block: np.ndarray,
    vdot_cmd: np.ndarray,
    f_cmd: np.ndarray,
    contact: np.ndarray,
    acceleration_block: np.ndarray,
    program_block: np.ndarray,
) -> bool:
    """Write this tick's numbers into a program and into its ``ContactAcceleration``; return whether they are finite.

    The equations of motion say √Q_1 δ_q = √Q_1 (S_fb H E)⁻¹ (S_fb J_cᵀ δ_f + what f_cmd leaves missing) = G x + g.
    """
    state, program = configuration_in(state_block), program_in(program_block)
    acceleration = contact_acceleration_in(acceleration_block)
    write_contact_acceleration(state, contact, acceleration)
    missing = _missing_wrench(state, vdot_cmd, f_cmd, contact)
    for row in range(N_BASE):
        program.g[row] = 0.0
        for k in range(N_BASE):
            program.g[row] += program.root_base * acceleration.inverse[row, k] * missing[k]
    n = 0
    for i in range(len(contact)):
        if contact[i]:
            _write_point(state, acceleration, program, i, n)
            _write_pyramid(program, f_cmd[i], n)
            n += 1
    return _write_cost(program)


@compiled
def _write_point(
    state: Configuration, acceleration: ContactAcceleration, program: QuadraticProgram, point: int, n: int
) -> None:
    """Write the columns of G of a contact point, the n-th that bears load."""
    scale = program.root_base / program.root_force
    for axis in range(3):
        for row in range(N_BASE):
            lift = 0.0
            for k in range(N_BASE):
                lift += acceleration.inverse[row, k] * state.J_contacts[point, axis, k]
            program.G[row, 3 * n + axis] = scale * lift


@compiled
def _write_pyramid(program: QuadraticProgram, f_cmd: np.ndarray, n: int) -> None:
    """Write the bounds of the n-th loaded point's friction pyramid, for its commanded force ``(3,)`` [N]."""
    for face in range(FACES * n, FACES * (n + 1)):
        inside = 0.0
        for axis in range(3):
            inside += program.A[face, 3 * n + axis] * f_cmd[axis]
        program.lower[face] = -program.root_force * inside


@compiled
def _write_cost(program: QuadraticProgram) -> bool:
    """Write H = 1 + Gᵀ G and f = Gᵀ g; return whether f is finite."""
    H, f, G, g = program.H, program.f, program.G, program.g
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
def write_limits(
    state_block: np.ndarray,
    vdot_cmd: np.ndarray,
    f_cmd: np.ndarray,
    contact: np.ndarray,
    acceleration_block: np.ndarray,
    headroom: TorqueHeadroom,
    program_block: np.ndarray,
) -> None:
    """Write the rows of the torques into a program of which the rest is written.

    They say least ≤ τ_cmd + H_j E δ_q − J_jᵀ δ_f ≤ greatest, the bounds moved apart to admit the torques without force.
    """
    state, program = configuration_in(state_block), program_in(program_block)
    acceleration = contact_acceleration_in(acceleration_block)
    A, lower, upper = program.A, program.lower, program.upper
    loaded, n_joints = np.flatnonzero(contact), len(headroom.least)
    begin = len(lower) - n_joints
    force, torque_cmd = np.zeros_like(f_cmd), np.empty(n_joints)
    H_E = state.M @ acceleration.E
    free = acceleration.inverse @ _missing_wrench(state, vdot_cmd, force, contact)
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
        bears = _subtract_forces(state, program, loaded, begin, j)
        if bears:
            lower[begin + j] = (min(headroom.least[j], without) - torque_cmd[j] - missing) / _LEVER
            upper[begin + j] = (max(headroom.greatest[j], without) - torque_cmd[j] - missing) / _LEVER
        else:
            lower[begin + j], upper[begin + j] = -INFINITY, INFINITY


@compiled
def _subtract_forces(state: Configuration, program: QuadraticProgram, loaded: np.ndarray, begin: int, j: int) -> bool:
    """Take J_jᵀ δ_f from the row of joint j; return whether any loaded point's force takes a torque of it."""
    bears = False
    for n, i in enumerate(loaded):
        for k in range(3):
            slope = state.J_contacts[i, k, JOINT_VELOCITY.start + j]
            bears |= slope != 0.0
            program.A[begin + j, 3 * n + k] -= slope / (_LEVER * program.root_force)
    return bears


@compiled
def write_solution(
    state_block: np.ndarray,
    vdot_cmd: np.ndarray,
    f_cmd: np.ndarray,
    contact: np.ndarray,
    acceleration_block: np.ndarray,
    df: np.ndarray,
    root_force: float,
    friction: float,
    solution_block: np.ndarray,
) -> bool:
    """Write q̈, f_r and τ; return whether they follow from √Q_2 δ_f, which is ``df`` ``(3 n,)``, or empty when there is none.

    The base's acceleration follows from the forces: the equations of motion hold to rounding.
    """
    state, acceleration = configuration_in(state_block), contact_acceleration_in(acceleration_block)
    memory = solution_in(solution_block)
    n = np.count_nonzero(contact)
    solved = len(df) == 3 * n
    for k in range(len(df)):
        solved = solved and np.isfinite(df[k])
    if solved:
        _write_optimal_forces(f_cmd, contact, df, root_force, memory.force)
    else:
        _write_fallback_forces(f_cmd, contact, friction, memory.force)
    if n == 0:
        write_contact_acceleration(state, contact, acceleration)
    missing = _missing_wrench(state, vdot_cmd, memory.force, contact)
    for i in range(len(memory.vdot)):
        memory.vdot[i] = vdot_cmd[i]
    for c in range(N_BASE):
        given = 0.0
        for k in range(N_BASE):
            given += acceleration.inverse[c, k] * missing[k]
        for i in range(len(memory.vdot)):
            memory.vdot[i] += acceleration.E[i, c] * given
    _inverse_dynamics(state, memory.vdot, memory.force, memory.torque)
    return solved


@compiled
def _write_optimal_forces(
    f_cmd: np.ndarray, contact: np.ndarray, df: np.ndarray, root_force: float, force: np.ndarray
) -> None:
    """Write f_cmd + δ_f ``(n_c, 3)`` [N] of the loaded points, else zero."""
    n = 0
    for i in range(len(contact)):
        for axis in range(3):
            force[i, axis] = f_cmd[i, axis] + df[3 * n + axis] / root_force if contact[i] else 0.0
        n += contact[i]


@compiled
def _write_fallback_forces(f_cmd: np.ndarray, contact: np.ndarray, friction: float, force: np.ndarray) -> None:
    """Write the commanded forces ``(n_c, 3)`` [N], moved into the friction pyramid."""
    for i in range(len(contact)):
        if not contact[i]:
            force[i] = 0.0
            continue
        normal = max(f_cmd[i, 2], 0.0)
        side = friction * normal
        force[i, 0] = min(max(f_cmd[i, 0], -side), side)
        force[i, 1] = min(max(f_cmd[i, 1], -side), side)
        force[i, 2] = normal


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
def _missing_wrench(state: Configuration, vdot_cmd: np.ndarray, force: np.ndarray, contact: np.ndarray) -> np.ndarray:
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
