"""Which contact points bear load, felt by the joints: what touches down early or late is noticed without a foot sensor.

The joint rows of the equations of motion leave what the contacts do,

    r = H_j q̈ + (C q̇ + G)_j + friction − τ = J_cjᵀ f ,

with q̈ from the change of the estimated velocity over a period, in which the motors gave the mean torque τ. A first-order
filter takes the rates' noise away, as the momentum observer of A. De Luca and R. Mattone (ICRA 2003) does, from which it
differs by the change of H within a period.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.kinematics import Configuration, configuration_in
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.linalg import cholesky, cholesky_solve
from aerial_model.robot.compiled_actuator import friction_of
from aerial_model.robot.robot import GRAVITY, JOINT_VELOCITY, Robot
from aerial_wbic.gains import TouchdownSensing

_REGULARIZATION = 1e-4  # [m²] keeps forces of stretched legs small instead of undefined


class _Losses(NamedTuple):
    """Friction of the joints ``(n,)``, and the width of its sign change [rad/s]."""

    damping: np.ndarray
    dry_friction: np.ndarray
    stiction_speed: float


class ContactSense:
    """Feels the contacts of one robot.

    Args:
        robot: the robot.
        sensing: how much of the weight counts as a contact, and how fast that is decided.
        stiction_speed: width of the friction's sign change [rad/s].
    """

    def __init__(self, robot: Robot, sensing: TouchdownSensing, stiction_speed: float) -> None:
        law = robot.actuators
        self._losses = _Losses(np.array(law.damping), np.array(law.dry_friction), stiction_speed)
        self._sensing = sensing
        self._threshold = sensing.share_of_weight * robot.mass * GRAVITY
        self._residual = np.zeros(robot.n_joints)
        self.forget()

    def forget(self) -> None:
        """Begin anew, with no contact felt."""
        self._residual[:] = 0.0
        self._before: tuple[float, np.ndarray] | None = None

    def update(self, time: float, state: Configuration, torque: np.ndarray) -> np.ndarray:
        """Return which points bear load ``(n_c,)`` bool.

        Args:
            time: of the state [s].
            state: of the robot.
            torque: that the motors gave, mean since the last update ``(n,)`` [N·m].
        """
        before, self._before = self._before, (time, state.v.copy())
        if before is None or time <= before[0]:
            return np.zeros(len(state.contact_positions), dtype=bool)
        dt = time - before[0]
        share = min(dt / self._sensing.filter_time, 1.0)
        force = _felt(self._residual, (state.v - before[1]) / dt, share, state.block, torque, self._losses)
        return force[:, 2] > self._threshold


@compiled
def _felt(
    residual: np.ndarray, vdot: np.ndarray, share: float, block: np.ndarray, torque: np.ndarray, losses: _Losses
) -> np.ndarray:
    """Draw the residual ``(n,)`` to what this period shows; return the contact forces ``(n_c, 3)`` [N] in W behind it."""
    state = configuration_in(block)
    speed = state.v[JOINT_VELOCITY]
    shown = state.M[JOINT_VELOCITY] @ vdot + state.nle[JOINT_VELOCITY] - torque
    shown += friction_of(speed, losses.damping, losses.dry_friction, losses.stiction_speed)
    residual += share * (shown - residual)
    n_c, n = len(state.J_contacts), len(residual)
    J = np.empty((3 * n_c, n))
    for i in range(n_c):
        J[3 * i : 3 * i + 3] = state.J_contacts[i, :, JOINT_VELOCITY]
    L = np.empty((3 * n_c, 3 * n_c))
    cholesky(J @ J.T + _REGULARIZATION * np.eye(3 * n_c), L)
    force = np.empty((3 * n_c, 1))
    force[:, 0] = J @ residual
    cholesky_solve(L, force)
    return force.copy().reshape(n_c, 3)
