"""Symbols of the kino-dynamic knots, their Euler steps and the kinematics they share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from aerial_model.robot.robot import BASE_TWIST, GRAVITY, JOINT_VELOCITY, Robot
from aerial_planner.kinematics.base_frame import BaseFrameModel, quaternion_product, quaternion_step, rotation_matrix

Matrix = np.ndarray | ca.SX
_POINT = 1e-3  # a contact nearer to its joint than this stands on no link [m]


@dataclass(frozen=True, kw_only=True)
class LegInertia:
    """What (3.14) neglects, from the mass matrix H at a given pose, rotor inertia included.

    With the base rows of the equations of motion solved for the base's acceleration, and their velocity terms left out,

        τ = (H_jj − H_jb H_bb⁻¹ H_bj) q̈_j + H_jb H_bb⁻¹ w − Jᵀ f ,   w = Σ [f_i; c_i × f_i] in B, about the base.

    The second term is large when contacts turn the body fast: in a roll it is a third of the ab/adduction's torque.
    τ is that of all n joints, held ones included, q̈_j that of the n_p joints that plans move.
    """

    joint: Matrix  # H_jj − H_jb H_bb⁻¹ H_bj (n, n_p) [kg·m²]
    wrench_share: Matrix  # H_jb H_bb⁻¹ (n, 6), linear first

    @staticmethod
    def along(robot: Robot, q_j: np.ndarray) -> LegInertia:
        """Return K of them in arrays, for a robot whose planned joints are at each of ``q_j`` ``(K, n_p)`` [rad]."""
        M = robot.mass_matrices(robot.with_held(q_j))
        coupling = M[:, BASE_TWIST, JOINT_VELOCITY]
        share = np.linalg.solve(M[:, BASE_TWIST, BASE_TWIST], coupling).transpose(0, 2, 1)
        joint = M[:, JOINT_VELOCITY, JOINT_VELOCITY] - share @ coupling
        return LegInertia(joint=joint[:, :, robot.planned_joints], wrench_share=share)

    def __getitem__(self, k: int) -> LegInertia:
        """Return one of K."""
        return LegInertia(joint=self.joint[k], wrench_share=self.wrench_share[k])

    @staticmethod
    def symbols(n: int, n_p: int) -> LegInertia:
        """Return parameters of a knot in its place."""
        return LegInertia(joint=ca.SX.sym("H_jj", n, n_p), wrench_share=ca.SX.sym("H_jb", n, 6))

    @property
    def parameters(self) -> Matrix:
        """All numbers as one column, which ``symbols`` stand for; of K a row each."""
        if isinstance(self.joint, np.ndarray):
            return np.concatenate([_by_columns(part) for part in (self.joint, self.wrench_share)], axis=-1)
        return ca.vertcat(ca.vec(self.joint), ca.vec(self.wrench_share))

    def torque(self, ddq_j: ca.SX, force_B: ca.SX, feet_B: ca.SX) -> ca.SX:
        """Return the joint torques ``(n,)`` but for −Jᵀf.

        Args:
            ddq_j: ``(n_p,)`` [rad/s²].
            force_B: of the contacts ``(3, n_c)`` in B [N].
            feet_B: contact points ``(3, n_c)`` in B [m].
        """
        moment = sum((ca.cross(feet_B[:, i], force_B[:, i]) for i in range(force_B.shape[1])), type(force_B).zeros(3))
        return ca.mtimes(self.joint, ddq_j) + ca.mtimes(self.wrench_share, ca.vertcat(ca.sum2(force_B), moment))


def _by_columns(matrices: np.ndarray) -> np.ndarray:
    """Return the entries of matrices ``(..., m, n)``, column by column ``(..., m n)``."""
    return matrices.swapaxes(-1, -2).reshape(*matrices.shape[:-2], -1)


class TakeOffKnot:
    """Symbols of a take-off knot and its Euler step (3.5, 3.6).

    Args:
        robot: the robot, as plans see it.
        model: its expressions.
        n_whole: number of its joints, held ones included.
        loaded: which contacts push.
        in_flight: the lift-off knot.
        last: the one before it, whose control has the rates at which the contacts end of the joints that hold them.
        timed: the state has the factor by which all time steps of this phase are longer than the schedule's.
        ends_phase: the control has that of the next phase.
    """

    def __init__(
        self,
        robot: Robot,
        model: BaseFrameModel,
        loaded: Sequence[bool],
        *,
        n_whole: int,
        in_flight: bool = False,
        last: bool = False,
        timed: bool = False,
        ends_phase: bool = False,
    ) -> None:
        n, n_c = robot.n_joints, robot.n_contacts
        self._model = model
        self.r, self.rdot, self.alpha = (ca.SX.sym(name, 3) for name in ("r", "rdot", "alpha"))
        self.quaternion, self.q_j = ca.SX.sym("quat", 4), ca.SX.sym("q_j", n)
        self.omega, self.dq_j = ca.SX.sym("omega", 3), ca.SX.sym("dq_j", n)
        self.force = {int(i): ca.SX.sym(f"f_{i}", 3) for i in np.flatnonzero(loaded)}
        self.f = ca.vertcat(*self.force.values())
        self.quaternion_mid, self.q_j_mid = ca.SX.sym("quat_mid", 4), ca.SX.sym("q_j_mid", n)  # see ``shorthands``
        self.dq_before = ca.SX.sym("dq_before", n)
        self.motion = ca.vertcat(self.r, self.rdot, self.alpha, self.quaternion, self.q_j, self.dq_before)
        self.stretch = ca.SX.sym("stretch", int(timed))
        self.next_stretch = ca.SX.sym("next_stretch") if timed and ends_phase else self.stretch
        self.x = ca.vertcat(self.motion, self.stretch)
        self.nominal_dt = ca.SX.sym("dt")
        self.dt = self.nominal_dt * self.stretch if timed else self.nominal_dt
        # Rates are the means of the steps, those at a knot the mean of the steps before and after it.
        self.dq_next, gained = self.dq_j, self.dq_j - self.dq_before
        self.dq_end = ca.SX.sym("dq_end", int(holding_joints(model, loaded).sum()) if last else 0)
        if last:
            self.dq_next = 1.5 * self.dq_j - 0.5 * self.dq_before  # joints that hold nothing go on as before
            self.dq_next[np.flatnonzero(holding_joints(model, loaded)).tolist()] = self.dq_end
            gained = self.dq_next - 0.5 * (self.dq_before + self.dq_j)
        self.ddq_j = gained / self.dt
        self.ddq_j_end = (self.dq_next - self.dq_j) / (0.5 * self.dt)  # of the second half of the last step, else zero
        self.foot_ref = ca.SX.sym("foot_ref", 3, n_c)
        if in_flight:
            self.omega_ground = ca.SX.sym("omega_ground", 3)
            self.flight_time, self.flight_time_ref = ca.SX.sym("T"), ca.SX.sym("T_ref")
            self.arm_rate = ca.SX.sym("arm_rate", len(robot.arms))
            self.u = ca.vertcat(self.omega, self.omega_ground, self.arm_rate, self.flight_time)
            self.landing_com = ca.SX.sym("landing_com", 3)
            self.flight_p = ca.SX.sym("flight_p", FlightKnot.n_parameters(robot))
            self.margin = ca.SX.sym(
                "margin", n_whole
            )  # share of the torque limits that the legs' flight may begin with
            self.flight_inertia = ca.SX.sym("H_flight", n_whole, n)
            self.onset = ca.SX.sym("onset", 2)  # see ``FlightPath.onset``
            landing = (self.flight_time_ref, self.landing_com, self.flight_p)
            flight = (self.margin, ca.vec(self.flight_inertia), self.onset)
            self.p = ca.vertcat(self.nominal_dt, ca.vec(self.foot_ref), *landing, *flight)
            return
        self.u = ca.vertcat(self.omega, self.dq_j, self.f, self.dq_end)
        if timed and ends_phase:
            self.u = ca.vertcat(self.u, self.next_stretch)
        self.r_ref, self.rdot_ref = ca.SX.sym("r_ref", 3), ca.SX.sym("rdot_ref", 3)
        self.quaternion_ref, self.q_j_ref = ca.SX.sym("quat_ref", 4), ca.SX.sym("q_j_ref", n)
        self.q_j_frozen = ca.SX.sym("q_j_frozen", n)
        self.x_0 = ca.SX.sym("x_0", self.motion.numel())
        self.margin = ca.SX.sym("margin", n_whole)  # share of torque and voltage limits that may be used
        self.leg_inertia = LegInertia.symbols(n_whole, n)
        self.p = ca.vertcat(
            self.nominal_dt,
            self.r_ref,
            self.rdot_ref,
            self.quaternion_ref,
            self.q_j_ref,
            self.q_j_frozen,
            ca.vec(self.foot_ref),
            self.x_0,
            self.margin,
            self.leg_inertia.parameters,
        )

    @property
    def R(self) -> ca.SX:  # noqa: N802
        return rotation_matrix(self.quaternion)

    @property
    def alpha_dot(self) -> ca.SX:
        """Mean moment of the forces over the interval, constant as they are (3.5)."""
        middle = mean_com(self.r, self.rdot, self.dt)
        return sum((ca.cross(self.foot_ref[:, i] - middle, f) for i, f in self.force.items()), ca.SX.zeros(3))

    @property
    def shorthands(self) -> dict[str, ca.SX]:
        """Attitude and joint angles at mid-interval, of which most is a function, as symbols and what they are."""
        quaternion_mid = quaternion_product(self.quaternion, quaternion_step(self.omega, 0.5 * self.dt))
        return {
            "y": ca.vertcat(self.quaternion_mid, self.q_j_mid),
            "y_is": ca.vertcat(quaternion_mid, self.q_j + 0.5 * self.dt * self.dq_j),
        }

    @property
    def R_mid(self) -> ca.SX:  # noqa: N802
        """Attitude at mid-interval, where a step's mean rates are the rates."""
        return rotation_matrix(self.quaternion_mid)

    def momentum_gap(self, model: BaseFrameModel) -> ca.SX:
        """Return Rᵀα − α_B at mid-interval (3.8)."""
        alpha_mid = self.alpha + 0.5 * self.dt * self.alpha_dot
        return self.R_mid.T @ alpha_mid - model.angular_momentum(self.q_j_mid, self.omega, self.dq_j)

    def step(self, mass: float) -> ca.SX:
        """Return the next state: (3.5) and (3.6); momentum is exact for forces that are constant over the interval."""
        rddot = -ca.vertcat(0, 0, GRAVITY)
        for f in self.force.values():
            rddot += f / mass
        rdot_next = self.rdot + rddot * self.dt
        return ca.vertcat(
            self.r + 0.5 * (self.rdot + rdot_next) * self.dt,
            rdot_next,
            self.alpha + self.alpha_dot * self.dt,
            quaternion_product(self.quaternion, quaternion_step(self.omega, self.dt)),
            self.q_j + self.dq_j * self.dt,
            self.dq_next,
            self.next_stretch,
        )


class FlightKnot:
    """A flight interval: α constant, legs on their path, the body turning so that (3.8) holds at mid-interval.

    Arms, joints that carry no contact point, are free: their rates ``(n_a,)`` are controls, those of the interval before
    part of the state.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        alpha: ca.SX,
        quaternion: ca.SX,
        q_j: ca.SX,
        flight_time: ca.SX,
        omega: ca.SX,
        arm_rate: ca.SX,
        arm_rate_before: ca.SX,
        p: ca.SX,
        first: bool = False,
    ) -> None:
        self.alpha, self.quaternion, self.q_j, self.omega = alpha, quaternion, q_j, omega
        self.flight_time, self.arm_rate = flight_time, arm_rate
        self.dt, self.fraction, self.target = p[0] * flight_time, p[1], p[2:]
        self.step_j = self.fraction * (self.target - q_j)
        if len(robot.arms) > 0:
            self.step_j[robot.arms.tolist()] = arm_rate * self.dt
        # Rates are the means of intervals; before the first they are those at its beginning.
        self.arm_acceleration = (arm_rate - arm_rate_before) / ((0.5 if first else 1.0) * self.dt)

    @staticmethod
    def n_parameters(robot: Robot) -> int:
        """Number of parameters: share of the flight time, fraction of the way to the target pose, the target pose."""
        return 2 + robot.n_joints

    def momentum_gap(self, model: BaseFrameModel) -> ca.SX:
        """Return Rᵀα − α_B at mid-interval (3.8)."""
        R_mid = rotation_matrix(quaternion_product(self.quaternion, quaternion_step(self.omega, 0.5 * self.dt)))
        return R_mid.T @ self.alpha - model.angular_momentum(
            self.q_j + 0.5 * self.step_j, self.omega, self.step_j / self.dt
        )

    def step(self) -> ca.SX:
        """Return α, attitude, joint angles, the flight time and the arms' rates at the end of the interval."""
        return ca.vertcat(
            self.alpha,
            quaternion_product(self.quaternion, quaternion_step(self.omega, self.dt)),
            self.q_j + self.step_j,
            self.flight_time,
            self.arm_rate,
        )


def mean_com(r: ca.SX, rdot: ca.SX, dt: ca.SX) -> ca.SX:
    """Return what to take moments about over an interval with constant forces ``(3,)`` [m].

    That is the mean of r(t) without the part that lies along the total force, which has no moment.
    """
    return r + 0.5 * dt * rdot - ca.vertcat(0, 0, GRAVITY * dt**2 / 6)


def holding_joints(model: BaseFrameModel, held: Sequence[bool]) -> np.ndarray:
    """Return the joints ``(n,)`` bool that move a held contact point."""
    J = np.array(ca.DM(model.foot_jacobians.sparsity_out(0), 1)) != 0  # (3 n_c, n)
    return J[np.repeat(np.asarray(held, dtype=bool), 3)].any(axis=0)


def world_feet(model: BaseFrameModel, s: TakeOffKnot) -> ca.SX:
    """Return c_i ``(3, n_c)`` [m] in S from the centre of mass and the attitude (3.7)."""
    relative = model.feet(s.q_j) - ca.repmat(model.com(s.q_j), 1, s.foot_ref.shape[1])
    return ca.repmat(s.r, 1, s.foot_ref.shape[1]) + s.R @ relative


def link_slopes(robot: Robot, model: BaseFrameModel, q_j: ca.SX, R: ca.SX) -> tuple[np.ndarray, ca.SX]:
    """Return the length ``(n_c,)`` [m] of the link that carries each contact point, and the sine ``(n_c,)`` of its slope."""
    q_0 = robot.poses["home"]
    lengths = np.linalg.norm(np.asarray(model.last_joints(q_0)) - np.asarray(model.feet(q_0)), axis=0)
    rise = (R @ (model.last_joints(q_j) - model.feet(q_j)))[2, :]
    lengths = np.maximum(lengths, _POINT)
    return lengths, rise.T / lengths


def foot_velocities(model: BaseFrameModel, s: TakeOffKnot) -> list[ca.SX]:
    """Return each ċ_i ``(3,)`` in B [m/s] at the rates at which the contacts end."""
    feet, com, J = model.feet(s.q_j), model.com(s.q_j), model.foot_jacobians(s.q_j)
    J_com = ca.jacobian(com, s.q_j)
    rates = []
    for i in range(s.foot_ref.shape[1]):
        relative = feet[:, i] - com
        rates.append(
            s.R.T @ s.rdot + ca.cross(s.omega_ground, relative) + (J[3 * i : 3 * i + 3, :] - J_com) @ s.dq_before
        )
    return rates
