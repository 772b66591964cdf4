"""Joint angles that put the contact points where they should be: damped Gauss–Newton over many configurations at once."""

from __future__ import annotations

import casadi as ca
import numpy as np

from aerial_model.robot import Robot
from aerial_planner.in_place import InPlace
from aerial_planner.symbolic import BaseFrameModel

_ITERATIONS = 12
_DAMPING = 1e-4  # [m²/rad²]
_STEP_MAX = 0.5  # [rad] per iteration
_STEP_MIN = 1e-5  # [rad] that is not worth another: the next would be its square


class InverseKinematics:
    """Solves for the feet's positions relative to the centre of mass, in base axes."""

    def __init__(self, robot: Robot, model: BaseFrameModel) -> None:
        q = ca.SX.sym("q", robot.n_joints)
        relative = ca.reshape(model.feet(q) - ca.repmat(model.com(q), 1, robot.n_contacts), -1, 1)
        outputs = [relative, ca.densify(ca.jacobian(relative, q))]
        self._feet = ca.Function("feet_from_com", [q], outputs, {"cse": True})
        self._mapped: dict[int, InPlace] = {}  # by the number of configurations
        self._range = robot.planning_range

    def solve(self, feet_from_com: np.ndarray, guess: np.ndarray) -> np.ndarray:
        """Return joint positions ``(K, n)`` [rad] inside the planning range.

        Args:
            feet_from_com: wanted foot positions ``(K, n_c, 3)`` [m] from the centre of mass, in B.
            guess: ``(n,)`` or ``(K, n)``.
        """
        targets = feet_from_com.reshape(len(feet_from_com), -1)
        q = np.broadcast_to(guess, (len(targets), np.shape(guess)[-1])).copy()
        K, n = q.shape
        if K not in self._mapped:
            self._mapped[K] = InPlace(self._feet, K)
        mapped = self._mapped[K]
        (q_in,), (feet, J) = mapped.arguments, mapped.results
        J = J.reshape(K, n, -1)  # transposed blocks, Jᵀ of each
        for _ in range(_ITERATIONS):
            q_in[:] = q.ravel()
            mapped.evaluate()
            error = targets - feet.reshape(K, -1)  # (K, 3 n_c)
            normal = J @ J.transpose(0, 2, 1) + _DAMPING * np.eye(n)
            step = np.linalg.solve(normal, (J @ error[..., None]))[..., 0]
            before, q = q, np.clip(q + np.clip(step, -_STEP_MAX, _STEP_MAX), *self._range)
            if np.max(np.abs(q - before)) < _STEP_MIN:
                break
        return q
