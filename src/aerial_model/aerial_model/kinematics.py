"""The robot at one configuration and velocity: every quantity the equations of the thesis's chapter 2 need.

A ``Configuration`` is the proof that its quantities belong together: functions take one instead of
``(model, data, q, v)``. Angular rows come first in ``A_G`` and ``Adot_v_G`` (thesis (2.5)); Pinocchio has them last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from aerial_model.compiled import compiled
from aerial_model.robot import BASE_ANGULAR, BASE_LINEAR, BASE_ORIENTATION, BASE_POSITION, Robot


class Configuration(NamedTuple):
    """Quantities of a robot at one state, in W with Pinocchio's v (base twist in B, linear first).

    A tuple of arrays, so that compiled code takes it as it is and writes into it: to return arrays to Python takes it a
    microsecond each.
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
    omega_contacts: np.ndarray  # angular velocities of the links the points are on (n_c, 3) [rad/s]

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


class Workspace(NamedTuple):
    """What a configuration is read from: mostly Pinocchio's own memory, because to look it up anew takes longer."""

    R_WB: np.ndarray  # (3, 3)
    M: np.ndarray  # upper triangle (nv, nv)
    M_inv: np.ndarray  # upper triangle (nv, nv)
    nle: np.ndarray  # (nv,)
    com: np.ndarray  # (3,)
    com_velocity: np.ndarray  # (3,)
    A_G: np.ndarray  # linear rows first (6, nv)
    Adot_G: np.ndarray  # the same
    angular_momentum: np.ndarray  # (3,)
    J: np.ndarray  # of every joint's spatial velocity at W's origin, linear rows first (6, nv)
    Jdot: np.ndarray  # the same
    contacts: np.ndarray  # centres of the contact spheres (n_c, 3)
    moving: np.ndarray  # which points which velocities move (n_c, nv) bool


class Kinematics:
    """Computes configurations of one robot in one Pinocchio workspace."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        model = robot.model
        self._data = data = model.createData()
        self._contacts = [data.oMf[frame].translation for frame in robot.contact_frames]
        moving = np.zeros((len(self._contacts), model.nv), dtype=bool)
        for i, frame in enumerate(robot.contact_frames):
            for joint in list(model.supports[model.frames[frame].parentJoint])[1:]:  # 0: the universe
                first = model.joints[joint].idx_v
                moving[i, first : first + model.joints[joint].nv] = True
        self._workspace = Workspace(
            data.oMi[1].rotation,
            data.M,
            data.Minv,
            data.nle,
            data.com[0],
            data.vcom[0],
            data.Ag,
            data.dAg,
            data.hg.angular,
            data.J,
            data.dJ,
            np.array(self._contacts),
            moving,
        )

    def at(self, q: np.ndarray, v: np.ndarray) -> Configuration:
        """Return the robot at ``q`` ``(nq,)`` with velocity ``v`` ``(nv,)``, both copied."""
        state = self.blank()
        state.q[:] = q
        state.v[:] = v
        fill(state, self.computed(state.q, state.v))
        return state

    def blank(self) -> Configuration:
        """Return the memory of a configuration."""
        nq, nv, n_c = self.robot.model.nq, self.robot.model.nv, self.robot.n_contacts
        shapes = {
            "q": nq,
            "v": nv,
            "R_WB": (3, 3),
            "M": (nv, nv),
            "M_inv": (nv, nv),
            "nle": nv,
            "com": 3,
            "com_velocity": 3,
            "A_G": (6, nv),
            "Adot_v_G": 6,
            "angular_momentum": 3,
            "contact_positions": (n_c, 3),
            "J_contacts": (n_c, 3, nv),
            "Jdot_v_contacts": (n_c, 3),
            "omega_contacts": (n_c, 3),
        }
        return Configuration(mass=self.robot.mass, **{name: np.zeros(shape) for name, shape in shapes.items()})

    def computed(self, q: np.ndarray, v: np.ndarray) -> Workspace:
        """Return what ``fill`` needs to know about a robot at ``q`` and ``v``; the next call overwrites it."""
        model, data = self.robot.model, self._data
        pin.computeMinverse(model, data, q)
        pin.crba(model, data, q)
        pin.nonLinearEffects(model, data, q, v)
        pin.dccrba(model, data, q, v)
        pin.updateFramePlacements(model, data)
        for i, centre in enumerate(self._contacts):
            self._workspace.contacts[i] = centre
        return self._workspace


@compiled
def fill(state: Configuration, workspace: Workspace) -> None:
    """Write into a configuration all that follows from its q and v, for which the workspace was computed."""
    contacts, moving, v = workspace.contacts, workspace.moving, state.v
    nv, n_c = len(v), len(contacts)
    for i in range(nv):
        for j in range(i, nv):
            state.M[i, j] = state.M[j, i] = workspace.M[i, j]
            state.M_inv[i, j] = state.M_inv[j, i] = workspace.M_inv[i, j]
    state.R_WB[:] = workspace.R_WB
    state.nle[:] = workspace.nle
    state.com[:] = workspace.com
    state.com_velocity[:] = workspace.com_velocity
    state.angular_momentum[:] = workspace.angular_momentum
    state.contact_positions[:] = contacts
    for row in range(6):
        other = (row + 3) % 6  # Pinocchio has linear rows first
        state.Adot_v_G[row] = 0.0
        for k in range(nv):
            state.A_G[row, k] = workspace.A_G[other, k]
            state.Adot_v_G[row] += workspace.Adot_G[other, k] * v[k]
    J, bias, omega = state.J_contacts, state.Jdot_v_contacts, state.omega_contacts
    J[:] = 0.0
    bias[:] = 0.0
    omega[:] = 0.0
    turn, turn_rate, velocity = np.empty(3), np.empty(3), np.empty(3)
    for i in range(n_c):
        c = contacts[i]
        turn_rate[:] = 0.0
        velocity[:] = 0.0
        for k in range(nv):
            if not moving[i, k]:
                continue
            column, rate = workspace.J[:, k], workspace.Jdot[:, k]
            turn[0] = column[4] * c[2] - column[5] * c[1]  # ω × c of this column
            turn[1] = column[5] * c[0] - column[3] * c[2]
            turn[2] = column[3] * c[1] - column[4] * c[0]
            for axis in range(3):
                J[i, axis, k] = column[axis] + turn[axis]
                velocity[axis] += J[i, axis, k] * v[k]
                omega[i, axis] += column[3 + axis] * v[k]
                bias[i, axis] += rate[axis] * v[k]
                turn_rate[axis] += rate[3 + axis] * v[k]
        # ċ = v_O + ω × c has the rate v̇_O + ω̇ × c + ω × ċ.
        w = omega[i]
        bias[i, 0] += turn_rate[1] * c[2] - turn_rate[2] * c[1] + w[1] * velocity[2] - w[2] * velocity[1]
        bias[i, 1] += turn_rate[2] * c[0] - turn_rate[0] * c[2] + w[2] * velocity[0] - w[0] * velocity[2]
        bias[i, 2] += turn_rate[0] * c[1] - turn_rate[1] * c[0] + w[0] * velocity[1] - w[1] * velocity[0]


@compiled
def carry(state: Configuration, position: np.ndarray, velocity: np.ndarray) -> None:
    """Move a configuration whose base is at W's origin and linearly at rest, in place, to where it is and how fast.

    Shape, attitude and what turns stay. A velocity V that all points share is constant in B, as q̈ = 0 has it, only if in W
    it changes by ω × V: that is what the bias terms gain.

    Args:
        state: whose arrays change.
        position: of the base ``(3,)`` [m] in W.
        velocity: of the base, V ``(3,)`` [m/s] in W.
    """
    in_base = velocity @ state.R_WB
    state.q[BASE_POSITION] = position
    state.v[BASE_LINEAR] = in_base
    state.com[:] += position
    state.com_velocity[:] += velocity
    state.contact_positions[:] += position
    turning = np.cross(state.v[BASE_ANGULAR], in_base)
    state.nle[:] += np.ascontiguousarray(state.M[:, BASE_LINEAR]) @ turning
    gained = state.R_WB @ turning
    state.Adot_v_G[3:] += state.mass * gained
    state.Jdot_v_contacts[:] += gained
