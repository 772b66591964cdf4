"""Reaction forces that the ground can give and the base acceleration that follows from them, thesis (3.24).

    min δ_qᵀ Q_1 δ_q + δ_fᵀ Q_2 δ_f
    s.t. S_fb (H q̈ + C q̇ + G) = S_fb J_cᵀ f_r,   q̈ = q̈_cmd + [δ_q; 0],   f_r = f_cmd + δ_f,   W f_r ≥ 0.

OSQP is set up once for every number of loaded points; the sparsity never changes, a tick updates numbers and starts
from the last solution. Its penalty does not adapt to what it met before, so that equal input gives equal output to the
last bit. A fixed penalty converges only on a well scaled problem: the variables are √Q_1 δ_q and √Q_2 δ_f, and the rows of the equations of motion
are multiplied by √Q_1 H_bb⁻¹, so that cost and equality are both of unit size.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
import osqp
from scipy import sparse

from aerial_model.contact import friction_pyramid
from aerial_model.kinematics import Configuration
from aerial_model.robot import BASE_TWIST, Robot

_LOG = logging.getLogger(__name__)
_N_BASE = 6
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
_ACCEPTED = (osqp.SolverStatus.OSQP_SOLVED, osqp.SolverStatus.OSQP_SOLVED_INACCURATE)


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """Acceleration and forces that obey the equations of motion of the base."""

    vdot: np.ndarray  # (nv,) base as physics has it, joints as commanded
    force: np.ndarray  # f_r (n_c, 3) in W [N]; zero where no load is planned
    solved: bool  # False: the fallback's forces


class ForceOptimization:
    """The quadratic program of one robot.

    Args:
        robot: gives the number of contacts and the friction coefficient.
        weight_base: Q_1, the same for all six rows.
        weight_force: Q_2, the same for all forces.
    """

    def __init__(self, robot: Robot, weight_base: float, weight_force: float) -> None:
        self._pyramid = friction_pyramid(robot.friction_coefficient)
        self._programs = [_Program(n, self._pyramid, weight_base, weight_force) for n in range(1, robot.n_contacts + 1)]

    def solve(self, state: Configuration, vdot_cmd: np.ndarray, f_cmd: np.ndarray, contact: np.ndarray) -> Solution:
        """Return the forces and the acceleration of (3.24).

        When OSQP fails, the one fallback is: the commanded forces, moved into the friction pyramid.

        Args:
            state: of the robot.
            vdot_cmd: q̈_cmd ``(nv,)`` of the hierarchy.
            f_cmd: planned forces ``(n_c, 3)`` [N] in W.
            contact: points that carry load ``(n_c,)`` bool.
        """
        M_base = state.M[BASE_TWIST]  # (6, nv)
        M_bb_inv = np.linalg.inv(M_base[:, BASE_TWIST])
        missing = -(M_base @ vdot_cmd + state.nle[BASE_TWIST])  # what forces and δ_q must supply, (6,)
        loaded = np.flatnonzero(contact)
        force = np.zeros_like(f_cmd)
        solved = True
        if len(loaded):
            G = state.J_contacts[loaded, :, BASE_TWIST].reshape(-1, _N_BASE).T  # S_fb J_cᵀ (6, 3 n)
            f_0 = f_cmd[loaded].ravel()
            df = self._programs[len(loaded) - 1].solve(M_bb_inv @ G, M_bb_inv @ (missing + G @ f_0), f_0)
            solved = df is not None
            f_r = f_0 + df if df is not None else self._moved_into_pyramid(f_0)
            force[loaded] = f_r.reshape(-1, 3)
            missing = missing + G @ f_r
        # δ_q from the forces themselves, so that the equations of motion hold to rounding.
        vdot = vdot_cmd.copy()
        vdot[BASE_TWIST] += M_bb_inv @ missing
        return Solution(vdot=vdot, force=force, solved=solved)

    def _moved_into_pyramid(self, f: np.ndarray) -> np.ndarray:
        f = f.reshape(-1, 3).copy()
        f[:, 2] = np.maximum(f[:, 2], 0.0)
        mu = self._pyramid[0, 2]
        f[:, :2] = np.clip(f[:, :2], -mu * f[:, 2:], mu * f[:, 2:])
        return f.ravel()


class _Program:
    """OSQP for ``n`` loaded points.

    Variables: [√Q_1 δ_q (6); √Q_2 δ_f (3 n)]; rows: [equations of motion (6); pyramids (5 n)].
    """

    def __init__(self, n: int, pyramid: np.ndarray, weight_base: float, weight_force: float) -> None:
        self._W = np.kron(np.eye(n), pyramid)  # (5 n, 3 n)
        self._root_base, self._root_force = np.sqrt(weight_base), np.sqrt(weight_force)
        variables, rows = _N_BASE + 3 * n, _N_BASE + len(self._W)
        A = np.zeros((rows, variables))
        A[:_N_BASE, :_N_BASE] = np.eye(_N_BASE)
        A[:_N_BASE, _N_BASE:] = 1.0  # dense: changes with the state
        A[_N_BASE:, _N_BASE:] = self._W / self._root_force
        self._A = sparse.csc_matrix(A)
        column = np.repeat(np.arange(variables), np.diff(self._A.indptr))
        self._changing = (self._A.indices < _N_BASE) & (column >= _N_BASE)  # in the order of columns
        self._lower = np.zeros(rows)
        self._upper = np.full(rows, np.inf)
        self._solver = osqp.OSQP()
        self._solver.setup(
            sparse.eye(variables, format="csc"),
            np.zeros(variables),
            self._A,
            self._lower,
            self._upper,
            **_SETTINGS,
            **_USUAL,
        )

    def solve(self, lift: np.ndarray, supply: np.ndarray, f_0: np.ndarray) -> np.ndarray | None:
        """Return δ_f ``(3 n,)`` [N] of the best δ_q = ``lift`` δ_f + ``supply`` with W (f_0 + δ_f) ≥ 0, or None.

        Args:
            lift: H_bb⁻¹ S_fb J_cᵀ ``(6, 3 n)``, base acceleration per force.
            supply: δ_q at δ_f = 0 ``(6,)``.
            f_0: commanded forces ``(3 n,)`` [N].
        """
        self._A.data[self._changing] = (lift.T * (-self._root_base / self._root_force)).ravel()
        self._lower[:_N_BASE] = self._upper[:_N_BASE] = self._root_base * supply
        self._lower[_N_BASE:] = -(self._W @ f_0)
        try:
            self._solver.update(Ax=self._A.data, l=self._lower, u=self._upper)
            x = self._minimum()
            if x is None:
                self._solver.update_settings(**_HARD)
                x = self._minimum()
                self._solver.update_settings(**_USUAL)
        except (ValueError, osqp.OSQPException) as error:
            _LOG.warning("OSQP refused a problem: %s", error)
            return None
        if x is None:
            self._solver.warm_start(x=np.zeros(self._A.shape[1]), y=np.zeros(self._A.shape[0]))
            return None
        return x[_N_BASE:] / self._root_force

    def _minimum(self) -> np.ndarray | None:
        """Return the variables that OSQP finds; None if it gives up."""
        result = self._solver.solve(raise_error=False)
        solved = result.info.status_val in _ACCEPTED and np.all(np.isfinite(result.x))
        return result.x if solved else None
