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
from typing import NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from aerial_model.robot.robot import JOINT_VELOCITY, Robot
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
    machine_code: Callable[[ca.Function], Pointwise | None] = no_machine_code  # None: CasADi evaluates

    def coms(self, q_j: np.ndarray) -> np.ndarray:
        """Return the centre of mass ``(K, 3)`` [m] with the joints at ``(K, n)`` [rad]."""
        return self._com(q_j)[0]

    def feet_at(self, q_j: np.ndarray) -> np.ndarray:
        """Return the contact points ``(K, n_c, 3)`` [m] with the joints at ``(K, n)`` [rad]."""
        return self._feet(q_j)[0].reshape(len(q_j), -1, 3)

    def momenta(self, q_j: np.ndarray, dq_j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return I ``(K, 3, 3)`` [kg·m²] and the angular momentum A_j q̇_j of the joints ``(K, 3)`` [kg·m²/s]."""
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
        """The functions that are evaluated with numbers."""
        return self._com, self._feet, self._momenta


def base_frame_model(
    robot: Robot, machine_code: Callable[[ca.Function], Pointwise | None] = no_machine_code
) -> BaseFrameModel:
    """Return the CasADi functions of a robot.

    Args:
        robot: the robot.
        machine_code: returns the machine code of a function; None: there is none, and CasADi evaluates it.
    """
    q = ca.SX.sym("q_j", robot.n_joints)
    dq = ca.SX.sym("dq_j", robot.n_joints)
    omega = ca.SX.sym("omega", 3)
    joints = _joint_frames(robot.model, q, dq, omega)
    com, alpha = _centre_and_momentum(robot.model, joints)
    feet, last_joints = _contact_points(robot, joints)
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


class _JointFrame(NamedTuple):
    """The frame that moves with a joint, in base axes, while the base origin is at rest."""

    R: ca.SX  # attitude in B (3, 3)
    p: ca.SX  # origin (3,) [m]
    w: ca.SX  # angular velocity (3,) [rad/s]
    v: ca.SX  # velocity of the origin (3,) [m/s]


def _joint_frames(model: pin.Model, q: ca.SX, dq: ca.SX, omega: ca.SX) -> list[_JointFrame]:
    """Return the frame of each joint by recursion from the base, which is joint 1 and turns at ``omega`` ``(3,)`` in B."""
    frames = [_JointFrame(R=ca.SX.eye(3), p=ca.SX.zeros(3), w=omega, v=ca.SX.zeros(3))] * 2
    for joint in range(2, model.njoints):
        i = model.idx_vs[joint] - JOINT_VELOCITY.start
        parent = frames[model.parents[joint]]
        placement = model.jointPlacements[joint]
        R_joint, p_joint, axis, prismatic = _joint_motion(model.joints[joint], q[i])
        R_parent_child = _constant(placement.rotation) @ R_joint
        p_parent_child = _constant(placement.translation) + _constant(placement.rotation) @ p_joint
        R = parent.R @ R_parent_child
        arm = parent.R @ p_parent_child
        axis_B = R @ axis
        frames.append(
            _JointFrame(
                R=R,
                p=parent.p + arm,
                w=parent.w + (ca.SX.zeros(3) if prismatic else axis_B * dq[i]),
                v=parent.v + ca.cross(parent.w, arm) + (axis_B * dq[i] if prismatic else ca.SX.zeros(3)),
            )
        )
    return frames


def _centre_and_momentum(model: pin.Model, joints: list[_JointFrame]) -> tuple[ca.SX, ca.SX]:
    """Return the centre of mass ``(3,)`` [m] and the angular momentum about it ``(3,)`` [kg·m²/s], summed over links."""
    mass, moment, linear = 0.0, ca.SX.zeros(3), ca.SX.zeros(3)
    angular = ca.SX.zeros(3)  # about the base origin
    for frame, body in zip(joints[1:], list(model.inertias)[1:], strict=True):
        lever = frame.R @ _constant(body.lever)
        position = frame.p + lever
        momentum = body.mass * (frame.v + ca.cross(frame.w, lever))
        spin = frame.R @ (_constant(body.inertia) @ (frame.R.T @ frame.w))
        mass += body.mass
        moment += body.mass * position
        linear += momentum
        angular += ca.cross(position, momentum) + spin
    com = moment / mass
    return com, angular - ca.cross(com, linear)


def _contact_points(robot: Robot, joints: list[_JointFrame]) -> tuple[list[ca.SX], list[ca.SX]]:
    """Return each contact point ``(3,)`` [m], and the origin of the joint that carries it."""
    feet, last_joints = [], []
    for frame_id in robot.contact_frames:
        frame = robot.model.frames[frame_id]
        parent = joints[frame.parentJoint]
        last_joints.append(parent.p)
        feet.append(parent.p + parent.R @ _constant(frame.placement.translation))
    return feet, last_joints


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
