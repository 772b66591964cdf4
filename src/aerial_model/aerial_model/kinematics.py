"""The robot at one configuration and velocity: every quantity the equations of the thesis's chapter 2 need.

A ``Configuration`` is the proof that its quantities are current: functions take one instead of ``(model, data, q, v)``.
Angular rows come first in ``A_G`` and ``h_G`` (thesis (2.5)); Pinocchio has them last.
"""

from __future__ import annotations

from functools import cache, cached_property

import numpy as np
import pinocchio as pin

from aerial_model.robot import BASE_ORIENTATION, BASE_POSITION, Robot


class Kinematics:
    """Computes configurations of one robot, reusing one Pinocchio workspace: each new configuration ends the last."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._data = robot.model.createData()
        self._zero = np.zeros(robot.model.nv)

    def at(self, q: np.ndarray, v: np.ndarray) -> Configuration:
        """Return the robot at ``q`` ``(nq,)`` with velocity ``v`` ``(nv,)``."""
        model, data = self.robot.model, self._data
        pin.computeMinverse(model, data, q)
        pin.computeAllTerms(model, data, q, v)
        # Second order at zero acceleration: the bias terms J̇ q̇ and Ȧ_G q̇.
        pin.computeCentroidalMomentumTimeVariation(model, data, q, v, self._zero)
        pin.updateFramePlacements(model, data)
        return Configuration(self.robot, data, q, v)


class Configuration:
    """Quantities of a robot at one state, in W with Pinocchio's v (base twist in B, linear first).

    Arrays are handed out as copies: Pinocchio's own would change with the next state, or outlive their memory. The
    large ones are made once per state and are read-only.
    """

    def __init__(self, robot: Robot, data: pin.Data, q: np.ndarray, v: np.ndarray) -> None:
        self.robot = robot
        self.q = q
        self.v = v
        self._data = data

    @cached_property
    def M(self) -> np.ndarray:  # noqa: N802  (the field's symbol)
        """Mass matrix H ``(nv, nv)``, rotor inertia included."""
        return _symmetric(self._data.M)

    @cached_property
    def M_inv(self) -> np.ndarray:  # noqa: N802
        """Inverse of the mass matrix H⁻¹ ``(nv, nv)``."""
        return _symmetric(self._data.Minv)

    @property
    def nle(self) -> np.ndarray:
        """Non-linear effects C q̇ + G ``(nv,)``."""
        return self._data.nle.copy()

    @property
    def base_position(self) -> np.ndarray:
        """Base position ``(3,)`` [m]."""
        return self.q[BASE_POSITION]

    @property
    def base_orientation(self) -> np.ndarray:
        """Base attitude ``(4,)``, quaternion xyzw."""
        return self.q[BASE_ORIENTATION]

    @property
    def R_WB(self) -> np.ndarray:  # noqa: N802
        """Base attitude as a matrix ``(3, 3)``."""
        return self._data.oMi[1].rotation.copy()

    @property
    def com(self) -> np.ndarray:
        """Centre of mass r ``(3,)`` [m]."""
        return self._data.com[0].copy()

    @property
    def com_velocity(self) -> np.ndarray:
        """Velocity of the centre of mass ṙ ``(3,)`` [m/s]."""
        return self._data.vcom[0].copy()

    @cached_property
    def A_G(self) -> np.ndarray:  # noqa: N802
        """Centroidal momentum matrix ``(6, nv)``, angular rows first (2.5)."""
        A = self._data.Ag
        return _read_only(np.concatenate([A[3:], A[:3]]))

    @property
    def angular_momentum(self) -> np.ndarray:
        """Centroidal angular momentum α ``(3,)`` [kg·m²/s]."""
        return self._data.hg.angular.copy()

    @property
    def Adot_v_G(self) -> np.ndarray:  # noqa: N802
        """Momentum bias Ȧ_G q̇ ``(6,)``, angular rows first (2.8)."""
        return np.concatenate([self._data.dhg.angular, self._data.dhg.linear])

    def contact_position(self, i: int) -> np.ndarray:
        """Centre of contact sphere ``i``: c_i ``(3,)`` [m]."""
        return self._data.oMf[self.robot.contact_frames[i]].translation.copy()

    @cached_property
    def contact_positions(self) -> np.ndarray:
        """All c_i ``(n_c, 3)`` [m]."""
        return _read_only(np.array([self._data.oMf[frame].translation for frame in self.robot.contact_frames]))

    def contact_velocity(self, i: int) -> np.ndarray:
        """Velocity ċ_i ``(3,)`` [m/s]."""
        frame = self.robot.contact_frames[i]
        return pin.getFrameVelocity(self.robot.model, self._data, frame, pin.LOCAL_WORLD_ALIGNED).linear

    @cached_property
    def J_contacts(self) -> np.ndarray:  # noqa: N802
        """Jacobians of all contact points ``(n_c, 3, nv)`` with ċ_i = J_c,i q̇."""
        model, data, frames = self.robot.model, self._data, self.robot.contact_frames
        return _read_only(
            np.array([pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:3] for frame in frames])
        )

    def J_c(self, i: int) -> np.ndarray:  # noqa: N802
        """Jacobian of contact point ``i`` ``(3, nv)``."""
        return self.J_contacts[i]

    def Jdot_v_c(self, i: int) -> np.ndarray:  # noqa: N802
        """Bias acceleration J̇_c,i q̇ ``(3,)`` [m/s²]: the point's classical acceleration at q̈ = 0."""
        frame = self.robot.contact_frames[i]
        model, data = self.robot.model, self._data
        return pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear


def _symmetric(upper: np.ndarray) -> np.ndarray:
    """Return the symmetric matrix of which Pinocchio gives the upper triangle."""
    return _read_only(np.where(_below_diagonal(len(upper)), upper.T, upper))


@cache
def _below_diagonal(n: int) -> np.ndarray:
    return _read_only(np.tri(n, k=-1, dtype=bool))


def _read_only(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array
