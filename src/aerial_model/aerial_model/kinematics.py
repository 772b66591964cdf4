"""The robot at one configuration and velocity: every quantity the equations of the thesis's chapter 2 need.

A ``Configuration`` is the proof that its quantities belong together: functions take one instead of
``(model, data, q, v)``. Angular rows come first in ``A_G`` and ``Adot_v_G`` (thesis (2.5)); Pinocchio has them last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from aerial_model.robot import BASE_ORIENTATION, BASE_POSITION, Robot

_ANGULAR_FIRST = [3, 4, 5, 0, 1, 2]


class Configuration(NamedTuple):
    """Quantities of a robot at one state, in W with Pinocchio's v (base twist in B, linear first).

    A tuple of arrays of its own, so that compiled code takes it as it is.
    """

    q: np.ndarray  # (nq,)
    v: np.ndarray  # q̇ (nv,)
    mass: float  # [kg]
    R_WB: np.ndarray  # base attitude (3, 3)
    M: np.ndarray  # mass matrix H (nv, nv), rotor inertia included
    M_inv: np.ndarray  # H⁻¹ (nv, nv)
    nle: np.ndarray  # non-linear effects C q̇ + G (nv,)
    com: np.ndarray  # centre of mass r (3,) [m]
    com_velocity: np.ndarray  # ṙ (3,) [m/s]
    A_G: np.ndarray  # centroidal momentum matrix (6, nv), angular rows first (2.5)
    Adot_v_G: np.ndarray  # momentum bias Ȧ_G q̇ (6,), angular rows first (2.8)
    angular_momentum: np.ndarray  # α about the centre of mass (3,) [kg·m²/s]
    contact_positions: np.ndarray  # centres of the contact spheres c_i (n_c, 3) [m]
    J_contacts: np.ndarray  # (n_c, 3, nv) with ċ_i = J_c,i q̇
    Jdot_v_contacts: np.ndarray  # J̇_c,i q̇ (n_c, 3) [m/s²]: the points' classical accelerations at q̈ = 0

    @property
    def base_position(self) -> np.ndarray:
        """Base position ``(3,)`` [m]."""
        return self.q[BASE_POSITION]

    @property
    def base_orientation(self) -> np.ndarray:
        """Base attitude ``(4,)``, quaternion xyzw."""
        return self.q[BASE_ORIENTATION]

    @property
    def contact_velocities(self) -> np.ndarray:
        """Velocities of the contact spheres' centres ċ_i ``(n_c, 3)`` [m/s]."""
        return self.J_contacts @ self.v


class Kinematics:
    """Computes configurations of one robot in one Pinocchio workspace."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._data = data = robot.model.createData()
        self._zero = np.zeros(robot.model.nv)
        self._below_diagonal = np.tri(robot.model.nv, k=-1, dtype=bool)
        # Pinocchio's own memory, which ``at`` copies from: to look it up anew takes longer than to copy it.
        self._rotation, self._M, self._M_inv, self._nle = data.oMi[1].rotation, data.M, data.Minv, data.nle
        self._com, self._com_velocity, self._A_G = data.com[0], data.vcom[0], data.Ag
        self._bias, self._angular_momentum = (data.dhg.angular, data.dhg.linear), data.hg.angular
        self._contacts = [data.oMf[frame].translation for frame in robot.contact_frames]

    def at(self, q: np.ndarray, v: np.ndarray) -> Configuration:
        """Return the robot at ``q`` ``(nq,)`` with velocity ``v`` ``(nv,)``."""
        model, data, frames = self.robot.model, self._data, self.robot.contact_frames
        pin.computeMinverse(model, data, q)
        pin.computeAllTerms(model, data, q, v)
        # Second order at zero acceleration: the bias terms J̇ q̇ and Ȧ_G q̇.
        pin.computeCentroidalMomentumTimeVariation(model, data, q, v, self._zero)
        pin.updateFramePlacements(model, data)
        axes = pin.LOCAL_WORLD_ALIGNED
        return Configuration(
            q=q,
            v=v,
            mass=self.robot.mass,
            R_WB=self._rotation.copy(),
            M=self._symmetric(self._M),
            M_inv=self._symmetric(self._M_inv),
            nle=self._nle.copy(),
            com=self._com.copy(),
            com_velocity=self._com_velocity.copy(),
            A_G=self._A_G.take(_ANGULAR_FIRST, axis=0),
            Adot_v_G=np.concatenate(self._bias),
            angular_momentum=self._angular_momentum.copy(),
            contact_positions=np.array(self._contacts),
            J_contacts=np.array([pin.getFrameJacobian(model, data, frame, axes)[:3] for frame in frames]),
            Jdot_v_contacts=np.array(
                [pin.getFrameClassicalAcceleration(model, data, frame, axes).linear for frame in frames]
            ),
        )

    def _symmetric(self, upper: np.ndarray) -> np.ndarray:
        """Return the symmetric matrix of which Pinocchio gives the upper triangle."""
        return np.where(self._below_diagonal, upper.T, upper)
