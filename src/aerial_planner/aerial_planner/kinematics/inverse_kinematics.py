"""Joint angles that put the contact points where they should be: damped Gauss–Newton over many configurations at once."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from aerial_model.numerics.jit import compiled
from aerial_model.numerics.linalg import cholesky, cholesky_solve
from aerial_model.robot.robot import Robot
from aerial_planner.codegen.batch import Batch, Pointwise, no_machine_code
from aerial_planner.kinematics.base_frame import BaseFrameModel

_ITERATIONS = 12
_DAMPING = 1e-4  # [m²/rad²]
_STEP_MAX = 0.5  # [rad] per iteration
_STEP_MIN = 1e-5  # [rad] after which no other is made: convergence is quadratic, the next would be its square


class InverseKinematics:
    """Solves for joint angles that put the feet where they should be relative to the centre of mass, in base axes.

    Args:
        robot: the robot, as plans see it.
        model: its expressions.
        machine_code: returns the machine code of a function; None: there is none, and CasADi evaluates it.
    """

    def __init__(
        self,
        robot: Robot,
        model: BaseFrameModel,
        machine_code: Callable[[ca.Function], Pointwise | None] = no_machine_code,
    ) -> None:
        q = ca.SX.sym("q", robot.n_joints)
        relative = ca.reshape(model.feet(q) - ca.repmat(model.com(q), 1, robot.n_contacts), -1, 1)
        self.feet = Batch(ca.Function("feet_from_com", [q], [relative, ca.jacobian(relative, q)]), machine_code)
        self._range = robot.planning_range
        self.solve(np.zeros((1, robot.n_contacts, 3)), robot.poses["home"])  # so that no plan waits for Numba

    def solve(self, feet_from_com: np.ndarray, guess: np.ndarray) -> np.ndarray:
        """Return joint positions ``(K, n)`` [rad] inside the planning range.

        Args:
            feet_from_com: wanted foot positions ``(K, n_c, 3)`` [m] from the centre of mass, in B.
            guess: ``(n,)`` or ``(K, n)``.
        """
        targets = feet_from_com.reshape(len(feet_from_com), -1)
        q = np.broadcast_to(guess, (len(targets), np.shape(guess)[-1])).copy()
        K, n = q.shape
        (q_in,), (feet, J), evaluate = self.feet.memory(K)
        feet, J = feet.reshape(K, -1), J.reshape(K, n, -1)  # transposed blocks, Jᵀ of each
        for _ in range(_ITERATIONS):
            q_in[:] = q.ravel()
            evaluate()
            if _step(q, J, targets, feet, *self._range) < _STEP_MIN:
                break
        return q


@compiled
def _step(
    q: np.ndarray, J: np.ndarray, targets: np.ndarray, feet: np.ndarray, low: np.ndarray, high: np.ndarray
) -> float:
    """Move each configuration ``(K, n)`` by a step, inside its range, and return the largest change of an angle.

    Args:
        q: configurations.
        J: transposed Jacobians of the feet ``(K, n, m)``.
        targets: where they should be ``(K, m)``.
        feet: where they are ``(K, m)``.
        low: least angles ``(n,)``.
        high: greatest angles.
    """
    K, n, m = J.shape
    L, step, largest = np.empty((n, n)), np.empty((n, 1)), 0.0
    for k in range(K):
        normal = np.dot(J[k], J[k].T)
        for i in range(n):
            normal[i, i] += _DAMPING
            step[i, 0] = 0.0
            for j in range(m):
                step[i, 0] += J[k, i, j] * (targets[k, j] - feet[k, j])
        cholesky(normal, L)
        cholesky_solve(L, step)
        for i in range(n):
            to = q[k, i] + min(max(step[i, 0], -_STEP_MAX), _STEP_MAX)
            to = min(max(to, low[i]), high[i])
            largest = max(largest, abs(to - q[k, i]))
            q[k, i] = to
    return largest
