"""Reaction forces that the ground can give and the base acceleration that follows from them, thesis (3.24).

    min δ_qᵀ Q_1 δ_q + δ_fᵀ Q_2 δ_f
    s.t. S_fb (H q̈ + C q̇ + G) = S_fb J_cᵀ f_r,   q̈ = q̈_cmd + E δ_q,   f_r = f_cmd + δ_f,   W f_r ≥ 0.

In the thesis E = [1; 0]: the base alone accelerates otherwise than commanded, and feet that the ground holds would have to
slip. Here the acceleration is consistent with the contacts: E δ_q is the motion with that acceleration of the base in which loaded
points stay where they are, and of these the one of least kinetic energy of the joints. The forces are then those that the
ground really gives, and the torques those that go with them.

The equations of motion of the base give δ_q for any δ_f, so the forces are the only variables; they are scaled, x = √Q_2 δ_f,
as a fixed penalty needs it to converge. A solver is set up once for every number of loaded points; the sparsity never
changes, a tick updates numbers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.kinematics import Configuration
from aerial_model.robot.contact import friction_pyramid
from aerial_model.robot.robot import Robot
from aerial_wbic.force_qp.contact_acceleration import ContactAcceleration, blank_contact_acceleration
from aerial_wbic.force_qp.equations import (
    FACES,
    SOLUTION,
    SolutionMemory,
    TorqueHeadroom,
    solution_in,
    write_limits,
    write_program,
    write_solution,
)
from aerial_wbic.force_qp.solvers import INFINITY, Osqp, QpFactory, blank_program


class Solution(NamedTuple):
    """Acceleration, forces and torques that obey the equations of motion."""

    vdot: np.ndarray  # (nv,) as physics has it
    force: np.ndarray  # f_r (n_c, 3) in W [N]; zero where no load is planned
    torque: np.ndarray  # of the joints (n,) [N·m], thesis (2.2)
    solved: bool  # False: the fallback's forces


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
        self._acceleration = blank_contact_acceleration(robot.model.nv)
        blocks = [SOLUTION.block(n=robot.n_joints, n_c=robot.n_contacts) for _ in range(2)]
        self._free_memory, self._limited_memory = (solution_in(block) for block in blocks)

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
        df = self._programs[n - 1].solve(state, vdot_cmd, f_cmd, contact, self._acceleration) if n else _NO_FORCE
        return self._solution(self._free_memory, state, vdot_cmd, f_cmd, contact, df)

    def within(
        self,
        headroom: TorqueHeadroom,
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
        df = program.solve(state, vdot_cmd, f_cmd, contact, self._acceleration, headroom)
        limited = self._solution(self._limited_memory, state, vdot_cmd, f_cmd, contact, df)
        return limited._replace(solved=solution.solved) if limited.solved else solution

    def _solution(
        self,
        memory: SolutionMemory,
        state: Configuration,
        vdot_cmd: np.ndarray,
        f_cmd: np.ndarray,
        contact: np.ndarray,
        df: np.ndarray | None,
    ) -> Solution:
        """Return what follows from the optimum; with None, or what is not finite, the fallback."""
        solved = write_solution(
            state.block,
            vdot_cmd,
            f_cmd,
            contact,
            self._acceleration.block,
            _NO_FORCE if df is None else df,
            self._root_force,
            self._friction,
            memory.block,
        )
        return Solution(memory.vdot, memory.force, memory.torque, solved)


_NO_FORCE = np.zeros(0)


class _Program:
    """The problem of ``n`` loaded points and the limits of ``n_limits`` joints, all of them or none.

    Rows: [pyramids (5 n); torques (n_limits)].
    """

    def __init__(
        self, n: int, n_limits: int, pyramid: np.ndarray, weight_base: float, weight_force: float, solver: QpFactory
    ) -> None:
        root_base, root_force = float(np.sqrt(weight_base)), float(np.sqrt(weight_force))
        faces = FACES * n
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
        acceleration: ContactAcceleration,
        headroom: TorqueHeadroom | None = None,
    ) -> np.ndarray | None:
        """Return √Q_2 δ_f ``(3 n,)`` of the loaded points, or None if there is no optimum.

        Args:
            state: of the robot.
            vdot_cmd: q̈_cmd ``(nv,)``.
            f_cmd: planned forces ``(n_c, 3)`` [N] in W.
            contact: points that carry load ``(n_c,)`` bool.
            acceleration: memory that the tick's is written into.
            headroom: for a program with limits.
        """
        desired = state.block, vdot_cmd, f_cmd, contact, acceleration.block
        if not write_program(*desired, self._program.block):  # a solver might not end
            return None
        if headroom is not None:
            write_limits(*desired, headroom, self._program.block)
        return self._solver.minimum()
