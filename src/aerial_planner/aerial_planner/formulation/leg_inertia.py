"""The inertia of the legs, which (3.14) neglects, as the torque limits of take-off and flight count it."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from aerial_model.robot.robot import BASE_TWIST, JOINT_VELOCITY, Robot
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.kinematics.quaternion import Expression


@dataclass(frozen=True, kw_only=True)
class LegInertia:
    """Blocks of the mass matrix H, rotor inertia included, at K poses.

    With the base rows of the equations of motion solved for the base's acceleration, and their velocity terms left out,

        τ = (H_jj − H_jb H_bb⁻¹ H_bj) q̈_j + H_jb H_bb⁻¹ w − Jᵀ f ,   w = Σ [f_i; c_i × f_i] in B, about the base.

    The second term is large when contacts turn the body fast: in a roll it is a third of the ab/adduction's torque.
    τ is that of all n joints, held ones included, q̈_j that of the n_p joints that plans move.
    """

    joint: np.ndarray  # H_jj − H_jb H_bb⁻¹ H_bj (K, n, n_p) [kg·m²]
    wrench_share: np.ndarray  # H_jb H_bb⁻¹ (K, n, 6), linear first

    @staticmethod
    def at(robot: Robot, q_j: np.ndarray) -> LegInertia:
        """Return the inertia of a robot whose planned joints are at each of ``q_j`` ``(K, n_p)`` [rad]."""
        M = robot.mass_matrices(robot.with_held(q_j))
        coupling = M[:, BASE_TWIST, JOINT_VELOCITY]
        share = np.linalg.solve(M[:, BASE_TWIST, BASE_TWIST], coupling).transpose(0, 2, 1)
        joint = M[:, JOINT_VELOCITY, JOINT_VELOCITY] - share @ coupling
        return LegInertia(joint=joint[:, :, robot.planned_joints], wrench_share=share)

    @staticmethod
    def on_intervals(robot: Robot, guess: TakeOffTrajectory) -> LegInertia:
        """Return the inertia in the middle of each of the N take-off intervals of a guess."""
        return LegInertia.at(robot, 0.5 * (guess.joint_position[:-1] + guess.joint_position[1:]))


def inertial_torque(
    joint: Expression, wrench_share: Expression, ddq_j: Expression, force_B: Expression, feet_B: Expression
) -> Expression:
    """Return the joint torques ``(n,)`` [N·m] of the equation above but for −Jᵀf.

    Args:
        joint: H_jj − H_jb H_bb⁻¹ H_bj ``(n, n_p)`` [kg·m²].
        wrench_share: H_jb H_bb⁻¹ ``(n, 6)``, linear first.
        ddq_j: joint accelerations ``(n_p,)`` [rad/s²].
        force_B: forces on the contacts ``(3, n_c)`` in B [N].
        feet_B: contact points ``(3, n_c)`` in B [m].
    """
    moment = type(force_B).zeros(3)
    for i in range(force_B.shape[1]):
        moment = moment + ca.cross(feet_B[:, i], force_B[:, i])
    return ca.mtimes(joint, ddq_j) + ca.mtimes(wrench_share, ca.vertcat(ca.sum2(force_B), moment))
