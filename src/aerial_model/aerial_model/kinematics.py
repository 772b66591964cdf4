"""The robot at one configuration and velocity: every quantity the equations of the thesis's chapter 2 need.

A ``Configuration`` is the proof that its quantities belong together: functions take one instead of
``(model, data, q, v)``. Angular rows come first in ``A_G`` and ``Adot_v_G`` (thesis (2.5)); Pinocchio has them last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from aerial_model.numerics.components import ZERO, cross_of, sum_of
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.layout import Layout
from aerial_model.robot.robot import BASE_ORIENTATION, GRAVITY, JOINT_VELOCITY, Robot


class Configuration(NamedTuple):
    """Quantities of a robot at one state, in W with Pinocchio's v (base twist in B, linear first).

    A tuple of arrays, so that compiled code takes it as it is and writes into it: to return arrays to Python takes it a
    microsecond each. All of them lie in one block, unless someone copies them apart.
    """

    q: np.ndarray  # (nq,)
    v: np.ndarray  # q̇ (nv,)
    mass: float  # [kg]
    R_WB: np.ndarray  # base attitude (3, 3)
    M: np.ndarray  # mass matrix H (nv, nv), rotor inertia included
    L: np.ndarray  # its factor, H = Lᵀ L, lower triangular (nv, nv): zero where H is
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
    block: np.ndarray  # what all these arrays lie in

    @property
    def base_orientation(self) -> np.ndarray:
        """Base attitude ``(4,)``, quaternion xyzw."""
        return self.q[BASE_ORIENTATION]

    @property
    def contact_velocities(self) -> np.ndarray:
        """Velocities of the contact spheres' centres ċ_i ``(n_c, 3)`` [m/s]."""
        return self.J_contacts @ self.v


LAYOUT = Layout(
    sizes=("n", "n_c"),
    numbers=("mass",),
    arrays={
        "q": ("7 + n",),
        "v": ("6 + n",),
        "R_WB": (3, 3),
        "M": ("6 + n", "6 + n"),
        "L": ("6 + n", "6 + n"),
        "nle": ("6 + n",),
        "com": (3,),
        "com_velocity": (3,),
        "A_G": (6, "6 + n"),
        "Adot_v_G": (6,),
        "angular_momentum": (3,),
        "contact_positions": ("n_c", 3),
        "J_contacts": ("n_c", 3, "6 + n"),
        "Jdot_v_contacts": ("n_c", 3),
        "omega_contacts": ("n_c", 3),
    },
)
configuration_in = LAYOUT.reader(Configuration)


class Workspace(NamedTuple):
    """What a configuration is read from: mostly Pinocchio's own memory, because to look it up anew takes longer."""

    R_WB: np.ndarray  # (3, 3)
    M: np.ndarray  # upper triangle (nv, nv)
    nle: np.ndarray  # (nv,)
    com: np.ndarray  # (3,)
    A_G: np.ndarray  # linear rows first (6, nv)
    J: np.ndarray  # of every joint's spatial velocity at W's origin, linear rows first (6, nv)
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
        contacts = np.array(self._contacts)
        self._workspace = Workspace(
            data.oMi[1].rotation, data.M, data.nle, data.com[0], data.Ag, data.J, contacts, moving
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
        robot = self.robot
        return configuration_in(LAYOUT.block(n=robot.n_joints, n_c=robot.n_contacts, mass=robot.mass))

    def computed(self, q: np.ndarray, v: np.ndarray) -> Workspace:
        """Return what ``fill`` needs to know about a robot at ``q`` and ``v``; the next call overwrites it."""
        model, data = self.robot.model, self._data
        pin.crba(model, data, q, pin.Convention.WORLD)  # also J, A_G and the centre of mass
        pin.nonLinearEffects(model, data, q, v)
        pin.updateFramePlacements(model, data)
        for i, centre in enumerate(self._contacts):
            self._workspace.contacts[i] = centre
        return self._workspace


@compiled
def fill(state: Configuration, workspace: Workspace) -> None:
    """Write into a configuration all that follows from its q and v, for which the workspace was computed."""
    nv = len(state.v)
    for i in range(nv):
        state.nle[i] = workspace.nle[i]
        for j in range(i, nv):
            state.M[i, j] = state.M[j, i] = workspace.M[i, j]
    for i in range(3):
        state.com[i] = workspace.com[i]
        for j in range(3):
            state.R_WB[i, j] = workspace.R_WB[i, j]
    factorize(state.M, state.L)
    _fill_momentum(state, workspace.A_G)
    _fill_contacts(state, workspace)


@compiled
def factorize(M: np.ndarray, L: np.ndarray) -> None:
    """Write the factor of a mass matrix ``(nv, nv)``, M = Lᵀ L, into L, lower triangular.

    From the leaves of the kinematic tree to its root: what is zero in M, the entries of joints neither of which moves the
    other, stays zero (R. Featherstone, Rigid Body Dynamics Algorithms, 2008, section 6.5).
    """
    nv = len(M)
    for i in range(nv):
        for j in range(nv):
            L[i, j] = M[i, j] if j <= i else 0.0
    for k in range(nv - 1, -1, -1):
        pivot = np.sqrt(L[k, k])
        for i in range(k):
            L[k, i] /= pivot
        L[k, k] = pivot
        for i in range(k):
            factor = L[k, i]
            if factor != 0.0:
                for j in range(i + 1):
                    L[i, j] -= factor * L[k, j]


@compiled
def _fill_momentum(state: Configuration, A_G: np.ndarray) -> None:
    """Momenta and their bias; Pinocchio has the linear rows of ``A_G`` first."""
    A, bias, nle, mass = state.A_G, state.Adot_v_G, state.nle, state.mass
    for row in range(6):
        momentum = 0.0
        for k in range(len(state.v)):
            A[row, k] = A_G[(row + 3) % 6, k]
            momentum += A[row, k] * state.v[k]
        if row < 3:
            state.angular_momentum[row] = momentum
        else:
            state.com_velocity[row - 3] = momentum / mass
    # The first rows of C q̇ + G are the wrench on the base, in its axes, that q̈ = 0 takes; with the weight it is the rate.
    for i in range(3):
        bias[i] = bias[3 + i] = 0.0
        for k in range(3):
            bias[i] += state.R_WB[i, k] * nle[3 + k]
            bias[3 + i] += state.R_WB[i, k] * nle[k]
    x, y, z = state.q[0] - state.com[0], state.q[1] - state.com[1], state.q[2] - state.com[2]
    bias[0] += y * bias[5] - z * bias[4]
    bias[1] += z * bias[3] - x * bias[5]
    bias[2] += x * bias[4] - y * bias[3]
    bias[5] -= mass * GRAVITY


@compiled
def _fill_contacts(state: Configuration, workspace: Workspace) -> None:
    v, S, J = state.v, workspace.J, state.J_contacts
    linear_B = angular_B = ZERO  # twist of the base at W's origin
    for k in range(JOINT_VELOCITY.start):
        linear_B = sum_of(linear_B, (S[0, k], S[1, k], S[2, k]), v[k])
        angular_B = sum_of(angular_B, (S[3, k], S[4, k], S[5, k]), v[k])
    J[:] = 0.0
    for i in range(len(workspace.contacts)):
        c = (workspace.contacts[i, 0], workspace.contacts[i, 1], workspace.contacts[i, 2])
        linear, angular = linear_B, angular_B  # twist of the link
        rate = turn_rate = ZERO  # of that twist at q̈ = 0
        for k in range(len(v)):
            if not workspace.moving[i, k]:
                continue
            axis, turn = (S[0, k], S[1, k], S[2, k]), (S[3, k], S[4, k], S[5, k])
            if k >= JOINT_VELOCITY.start:
                # A column rests in the link that it moves: it changes with that link's twist. Those of the base cancel.
                linear, angular = sum_of(linear, axis, v[k]), sum_of(angular, turn, v[k])
                turn_rate = sum_of(turn_rate, cross_of(angular, turn), v[k])
                rate = sum_of(sum_of(rate, cross_of(angular, axis), v[k]), cross_of(linear, turn), v[k])
            J[i, 0, k], J[i, 1, k], J[i, 2, k] = sum_of(axis, cross_of(turn, c), 1.0)
        # ċ = v_O + ω × c has the rate v̇_O + ω̇ × c + ω × ċ.
        velocity = sum_of(linear, cross_of(angular, c), 1.0)
        bias = sum_of(sum_of(rate, cross_of(turn_rate, c), 1.0), cross_of(angular, velocity), 1.0)
        for k in range(3):
            state.contact_positions[i, k] = c[k]
            state.omega_contacts[i, k] = angular[k]
            state.Jdot_v_contacts[i, k] = bias[k]


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
    R, v = state.R_WB, state.v
    for k in range(3):
        state.q[k] = position[k]
        v[k] = R[0, k] * velocity[0] + R[1, k] * velocity[1] + R[2, k] * velocity[2]
        state.com[k] += position[k]
        state.com_velocity[k] += velocity[k]
    turning = cross_of((v[3], v[4], v[5]), (v[0], v[1], v[2]))
    for i in range(len(v)):
        state.nle[i] += state.M[i, 0] * turning[0] + state.M[i, 1] * turning[1] + state.M[i, 2] * turning[2]
    for k in range(3):
        gained = R[k, 0] * turning[0] + R[k, 1] * turning[1] + R[k, 2] * turning[2]
        state.Adot_v_G[3 + k] += state.mass * gained
        for i in range(len(state.contact_positions)):
            state.contact_positions[i, k] += position[k]
            state.Jdot_v_contacts[i, k] += gained
