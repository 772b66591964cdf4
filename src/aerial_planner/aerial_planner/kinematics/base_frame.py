"""The robot's kinematics and angular momentum as CasADi expressions in base coordinates.

A lean tree of our own instead of a general library: written in the base frame, without the base's position and velocity,
the angular momentum about the centre of mass is

    α_B = I(q_j) ω + A_j(q_j) q̇_j ,   α = R α_B ,

with a third of the operations of a world-frame recursion. Everything is read from the Pinocchio model, which the tests
hold it against.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
import pinocchio as pin

from aerial_model.robot.robot import Robot
from aerial_planner.codegen.batch import Batch, Pointwise, no_machine_code

_ROUNDING = 1e-12  # entries of constant placements below this are rounding, and cost operations


@dataclass(frozen=True, kw_only=True)
class BaseFrameModel:
    """CasADi functions of joint position q_j ``(n,)`` [rad], all in base axes B with origin at the base."""

    com: ca.Function  # q_j ↦ centre of mass (3,) [m]
    feet: ca.Function  # q_j ↦ contact points (3, n_c) [m]
    last_joints: ca.Function  # q_j ↦ origin of the joint that carries each contact point (3, n_c) [m]
    foot_jacobians: ca.Function  # q_j ↦ stacked ∂foot_i/∂q_j (3 n_c, n), sparse
    angular_momentum: ca.Function  # q_j, ω (3,) in B, q̇_j (n,) ↦ α_B (3,) about the centre of mass [kg·m²/s]
    inertia: ca.Function  # q_j ↦ locked rotational inertia about the centre of mass (3, 3) [kg·m²]
    machine_code: Callable[[ca.Function], Pointwise | None] = no_machine_code  # how numbers are had

    def coms(self, q_j: np.ndarray) -> np.ndarray:
        """Return the centre of mass ``(K, 3)`` [m] with the joints at ``(K, n)`` [rad]."""
        return self._com(q_j)[0]

    def feet_at(self, q_j: np.ndarray) -> np.ndarray:
        """Return the contact points ``(K, n_c, 3)`` [m] with the joints at ``(K, n)`` [rad]."""
        return self._feet(q_j)[0].reshape(len(q_j), -1, 3)

    def momenta(self, q_j: np.ndarray, dq_j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the inertia ``(K, 3, 3)`` [kg·m²] and the joints' angular momentum ``(K, 3)`` [kg·m²/s]; see ``inertia``."""
        inertia, momentum = self._momenta(q_j, dq_j)
        return inertia.reshape(-1, 3, 3), momentum  # symmetric

    @cached_property
    def _com(self) -> Batch:
        return Batch(self.com, self.machine_code)

    @cached_property
    def _feet(self) -> Batch:
        return Batch(self.feet, self.machine_code)

    @cached_property
    def _momenta(self) -> Batch:
        q_j, _, dq_j = self.angular_momentum.sx_in()
        still = self.angular_momentum(q_j, ca.SX.zeros(3), dq_j)
        return Batch(ca.Function("momenta", [q_j, dq_j], [self.inertia(q_j), still]), self.machine_code)

    @property
    def batches(self) -> tuple[Batch, ...]:
        """What numbers are had from."""
        return self._com, self._feet, self._momenta


def base_frame_model(
    robot: Robot, machine_code: Callable[[ca.Function], Pointwise | None] = no_machine_code
) -> BaseFrameModel:
    """Return the CasADi functions of a robot.

    Args:
        robot: the robot.
        machine_code: returns that of a function, None if there is none.
    """
    model = robot.model
    q = ca.SX.sym("q_j", robot.n_joints)
    dq = ca.SX.sym("dq_j", robot.n_joints)
    omega = ca.SX.sym("omega", 3)

    R: list[ca.SX] = [ca.SX.eye(3)] * 2  # attitude of each joint frame in B; index 1 is the base
    p: list[ca.SX] = [ca.SX.zeros(3)] * 2  # its origin
    w: list[ca.SX] = [omega, omega]  # its angular velocity
    v: list[ca.SX] = [ca.SX.zeros(3)] * 2  # its velocity, the base origin at rest
    for joint in range(2, model.njoints):
        i = model.idx_vs[joint] - 6
        parent = model.parents[joint]
        placement = model.jointPlacements[joint]
        R_joint, p_joint, axis, prismatic = _joint_motion(model.joints[joint], q[i])
        R_parent_child = _constant(placement.rotation) @ R_joint
        p_parent_child = _constant(placement.translation) + _constant(placement.rotation) @ p_joint
        R.append(R[parent] @ R_parent_child)
        arm = R[parent] @ p_parent_child
        p.append(p[parent] + arm)
        axis_B = R[-1] @ axis
        w.append(w[parent] + (ca.SX.zeros(3) if prismatic else axis_B * dq[i]))
        v.append(v[parent] + ca.cross(w[parent], arm) + (axis_B * dq[i] if prismatic else ca.SX.zeros(3)))

    mass, moment, linear = 0.0, ca.SX.zeros(3), ca.SX.zeros(3)
    angular = ca.SX.zeros(3)  # about the base origin
    for joint in range(1, model.njoints):
        body = model.inertias[joint]
        lever = R[joint] @ _constant(body.lever)
        position = p[joint] + lever
        momentum = body.mass * (v[joint] + ca.cross(w[joint], lever))
        inertia = _constant(body.inertia)
        spin = R[joint] @ (inertia @ (R[joint].T @ w[joint]))
        mass += body.mass
        moment += body.mass * position
        linear += momentum
        angular += ca.cross(position, momentum) + spin
    com = moment / mass
    alpha = angular - ca.cross(com, linear)

    feet, last_joints = [], []
    for frame_id in robot.contact_frames:
        frame = model.frames[frame_id]
        parent = frame.parentJoint
        last_joints.append(p[parent])
        feet.append(p[parent] + R[parent] @ _constant(frame.placement.translation))
    jacobians = ca.vertcat(*[ca.jacobian(foot, q) for foot in feet])
    inertia_at_com = ca.jacobian(alpha, omega)
    names = ["q_j"]
    return BaseFrameModel(
        com=ca.Function("com", [q], [com], names, ["com"]),
        feet=ca.Function("feet", [q], [ca.horzcat(*feet)], names, ["feet"]),
        last_joints=ca.Function("last_joints", [q], [ca.horzcat(*last_joints)], names, ["last_joints"]),
        foot_jacobians=ca.Function("foot_jacobians", [q], [jacobians], names, ["J"]),
        angular_momentum=ca.Function("alpha", [q, omega, dq], [alpha], ["q_j", "omega", "dq_j"], ["alpha_B"]),
        inertia=ca.Function("inertia", [q], [inertia_at_com], names, ["I"]),
        machine_code=machine_code,
    )


def rotation_matrix(quaternion: ca.SX) -> ca.SX:
    """Return R ``(3, 3)`` of a unit quaternion xyzw."""
    x, y, z, w = ca.vertsplit(quaternion)
    return ca.vertcat(
        ca.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        ca.horzcat(2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        ca.horzcat(2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def quaternion_product(a: ca.SX, b: ca.SX) -> ca.SX:
    """Return a ⊗ b of quaternions xyzw."""
    av, aw, bv, bw = a[:3], a[3], b[:3], b[3]
    return ca.vertcat(aw * bv + bw * av + ca.cross(av, bv), aw * bw - ca.dot(av, bv))


def conjugate(q: ca.SX) -> ca.SX:
    """Return the inverse of a unit quaternion xyzw."""
    return ca.vertcat(-q[:3], q[3])


def quaternion_step(omega: ca.SX, dt: ca.SX) -> ca.SX:
    """Return the quaternion of a turn by ω dt.

    The series of cos and sin(x)/x in x² = |ω dt / 2|² has no singularity at rest; up to 1 rad it is exact to 1e-10.
    """
    half = 0.5 * dt * omega
    s = ca.dot(half, half)
    cosine = 1 - s / 2 * (1 - s / 12 * (1 - s / 30 * (1 - s / 56 * (1 - s / 90))))
    sinc = 1 - s / 6 * (1 - s / 20 * (1 - s / 42 * (1 - s / 72 * (1 - s / 110))))
    return ca.vertcat(sinc * half, cosine)


def attitude_error(quaternion: ca.SX, reference: ca.SX) -> ca.SX:
    """Return twice the vector part of q_ref* ⊗ q: the rotation vector of small errors ``(3,)`` [rad]."""
    return 2 * quaternion_product(conjugate(reference), quaternion)[:3]


def _constant(array: np.ndarray) -> ca.DM:
    """Return a constant whose rounding noise is structural zero, so that it costs no operations."""
    return ca.sparsify(ca.DM(np.where(np.abs(array) < _ROUNDING, 0.0, array)))


def _joint_motion(joint: pin.JointModel, q: ca.SX) -> tuple[ca.SX, ca.SX, ca.DM, bool]:
    """Return attitude, displacement, axis (in the child frame) of a one-degree-of-freedom joint, and whether it slides."""
    data = joint.createData()
    joint.calc(data, np.zeros(joint.nq), np.zeros(joint.nv))  # nq = nv = 1, checked when the robot was loaded
    subspace = np.asarray(data.S).reshape(6)
    if np.any(np.abs(subspace[:3]) > _ROUNDING):
        axis = _constant(subspace[:3])
        return ca.SX.eye(3), axis * q, axis, True
    axis = _constant(subspace[3:])
    K = ca.sparsify(ca.skew(axis))
    return ca.SX.eye(3) + ca.sin(q) * K + (1 - ca.cos(q)) * ca.sparsify(K @ K), ca.SX(3, 1), axis, False
