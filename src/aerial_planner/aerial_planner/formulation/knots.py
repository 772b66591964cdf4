"""Knots of the kino-dynamic problem as expressions: Euler steps, accelerations, and the momentum agreement (3.8)."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from aerial_model.robot.robot import GRAVITY, Robot
from aerial_planner.formulation.vector_layout import StageLayout, StageSymbols
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.kinematics.quaternion import (
    Expression,
    quaternion_product,
    quaternion_step,
    rotation_matrix,
)

_POINT = 1e-3  # a contact nearer to its joint than this stands on no link [m]


class TakeOffKnot(StageSymbols):
    """A take-off knot with its Euler step (3.5, 3.6): rates are the means of the intervals.

    Args:
        layout: its variables and parameters.
        loaded: which contacts push ``(n_c,)``.
        ending: at the last knot, the joints ``(n,)`` bool that hold a contact point; they end at rates of their own, the
            others go on as before. None: any other knot.
    """

    def __init__(self, layout: StageLayout, loaded: Sequence[bool], ending: np.ndarray | None = None) -> None:
        super().__init__(layout)
        self.motion = self.x[: self.x_0.numel()]
        timed = self.stretch.numel() > 0
        self.step_time = self.dt * self.stretch if timed else self.dt
        self.stretch_after = self.next_stretch if self.next_stretch.numel() > 0 else self.stretch
        self.force = {i: self.f[:, column] for column, i in enumerate(np.flatnonzero(loaded).tolist())}
        self.mid = {"quaternion": ca.SX.sym("quat_mid", 4), "q_j": ca.SX.sym("q_j_mid", self.q_j.numel())}
        self.dq_next, gained = self.dq_j, self.dq_j - self.dq_before
        if ending is not None:
            self.dq_next = 1.5 * self.dq_j - 0.5 * self.dq_before
            self.dq_next[np.flatnonzero(ending).tolist()] = self.dq_end
            gained = self.dq_next - 0.5 * (self.dq_before + self.dq_j)
        self.ddq_j = gained / self.step_time
        self.ddq_j_end = (self.dq_next - self.dq_j) / (0.5 * self.step_time)  # in the second half of the last step

    @property
    def R(self) -> ca.SX:  # noqa: N802
        """Attitude ``(3, 3)`` at the knot."""
        return rotation_matrix(self.quaternion)

    @property
    def R_mid(self) -> ca.SX:  # noqa: N802
        """Attitude ``(3, 3)`` at mid-interval, where a step's mean rates are the rates."""
        return rotation_matrix(self.mid["quaternion"])

    @property
    def shorthands(self) -> dict[str, ca.SX]:
        """Attitude and joint angles at mid-interval, of which most is a function: their symbols, and what they are."""
        quaternion_mid = quaternion_product(self.quaternion, quaternion_step(self.omega, 0.5 * self.step_time))
        return {
            "y": ca.vertcat(self.mid["quaternion"], self.mid["q_j"]),
            "y_is": ca.vertcat(quaternion_mid, self.q_j + 0.5 * self.step_time * self.dq_j),
        }

    @property
    def alpha_dot(self) -> ca.SX:
        """Mean moment of the forces over the interval ``(3,)`` [N·m], constant as they are (3.5)."""
        middle = mean_com(self.r, self.rdot, self.step_time)
        moment = ca.SX.zeros(3)
        for i, f in self.force.items():
            moment = moment + ca.cross(self.foot_ref[:, i] - middle, f)
        return moment

    def momentum_gap(self, model: BaseFrameModel) -> ca.SX:
        """Return Rᵀα − α_B at mid-interval (3.8) ``(3,)`` [kg·m²/s]."""
        alpha_mid = self.alpha + 0.5 * self.step_time * self.alpha_dot
        return self.R_mid.T @ alpha_mid - model.angular_momentum(self.mid["q_j"], self.omega, self.dq_j)

    def step(self, mass: float) -> ca.SX:
        """Return the next state: (3.5) and (3.6); momentum is exact for forces that are constant over the interval."""
        dt, rddot = self.step_time, ca.SX(-ca.vertcat(0, 0, GRAVITY))
        for f in self.force.values():
            rddot = rddot + f / mass
        rdot_next = self.rdot + rddot * dt
        return self.layout.state.join(
            r=self.r + 0.5 * (self.rdot + rdot_next) * dt,
            rdot=rdot_next,
            alpha=self.alpha + self.alpha_dot * dt,
            quaternion=quaternion_product(self.quaternion, quaternion_step(self.omega, dt)),
            q_j=self.q_j + self.dq_j * dt,
            dq_before=self.dq_next,
            stretch=self.stretch_after,
        )


class LiftOffKnot(StageSymbols):
    """The knot at which the last contacts end; its joint rates ``dq_before`` are those with which they end."""

    @property
    def R(self) -> ca.SX:  # noqa: N802
        """Attitude ``(3, 3)``."""
        return rotation_matrix(self.quaternion)

    def momentum_gap(self, model: BaseFrameModel) -> ca.SX:
        """Return Rᵀα − α_B at the rates with which the contacts end (3.8) ``(3,)`` [kg·m²/s]."""
        return self.R.T @ self.alpha - model.angular_momentum(self.q_j, self.omega_ground, self.dq_before)

    @property
    def landing_gap(self) -> ca.SX:
        """From the goal to where the ballistic path ends ``(3,)`` [m]."""
        landing = self.r + self.T * self.rdot - ca.vertcat(0, 0, 0.5 * GRAVITY * self.T**2)
        return landing - self.landing_com

    def foot_velocities(self, model: BaseFrameModel) -> list[ca.SX]:
        """Return each ċ_i ``(3,)`` in B [m/s] at the rates with which the contacts end."""
        feet, com, J = model.feet(self.q_j), model.com(self.q_j), model.foot_jacobians(self.q_j)
        J_com = ca.jacobian(com, self.q_j)
        rates = []
        for i in range(self.foot_ref.shape[1]):
            relative = feet[:, i] - com
            turning = ca.cross(self.omega_ground, relative)
            rates.append(self.R.T @ self.rdot + turning + (J[3 * i : 3 * i + 3, :] - J_com) @ self.dq_before)
        return rates


class FlightInterval:
    """A flight interval: α constant, legs on their path, the body turning so that (3.8) holds at mid-interval.

    Arms, joints that carry no contact point, are free: their rates ``(n_a,)`` are controls, those of the interval before
    part of the state.

    Args:
        robot: the robot, as plans see it.
        s: symbols of the knot at which the interval begins.
        arm_rate_before: arms' rates on the interval before ``(n_a,)`` [rad/s]; at lift-off, at its beginning.
        first: the interval begins at lift-off.
    """

    def __init__(self, robot: Robot, s: StageSymbols, arm_rate_before: ca.SX, *, first: bool = False) -> None:
        self.alpha, self.quaternion, self.q_j, self.omega = s.alpha, s.quaternion, s.q_j, s.omega
        self.flight_time, self.arm_rate, self.pose_ahead = s.T, s.arm_rate, s.pose_ahead
        self.dt = s.share * s.T
        self.step_j = s.fraction * (s.pose_ahead - s.q_j)
        if len(robot.arms) > 0:
            self.step_j[robot.arms.tolist()] = s.arm_rate * self.dt
        self.arm_acceleration = (s.arm_rate - arm_rate_before) / ((0.5 if first else 1.0) * self.dt)

    def momentum_gap(self, model: BaseFrameModel) -> ca.SX:
        """Return Rᵀα − α_B at mid-interval (3.8) ``(3,)`` [kg·m²/s]."""
        R_mid = rotation_matrix(quaternion_product(self.quaternion, quaternion_step(self.omega, 0.5 * self.dt)))
        return R_mid.T @ self.alpha - model.angular_momentum(
            self.q_j + 0.5 * self.step_j, self.omega, self.step_j / self.dt
        )

    def step(self, flight: StageLayout) -> ca.SX:
        """Return the state of the next knot, which has the layout of ``flight``."""
        return flight.state.join(
            alpha=self.alpha,
            quaternion=quaternion_product(self.quaternion, quaternion_step(self.omega, self.dt)),
            q_j=self.q_j + self.step_j,
            T=self.flight_time,
            arm_rate_before=self.arm_rate,
        )


def mean_com(r: Expression, rdot: Expression, dt: Expression) -> Expression:
    """Return the point about which to take moments over an interval with constant forces ``(3,)`` [m].

    That is the mean of r(t) without the part that lies along the total force, which has no moment.
    """
    return r + 0.5 * dt * rdot - ca.vertcat(0, 0, GRAVITY * dt**2 / 6)


def holding_joints(model: BaseFrameModel, held: Sequence[bool]) -> np.ndarray:
    """Return the joints ``(n,)`` bool that move a held contact point."""
    J = np.array(ca.DM(model.foot_jacobians.sparsity_out(0), 1)) != 0  # (3 n_c, n)
    return np.asarray(J[np.repeat(np.asarray(held, dtype=bool), 3)].any(axis=0))


def world_feet(model: BaseFrameModel, s: TakeOffKnot | LiftOffKnot) -> ca.SX:
    """Return c_i ``(3, n_c)`` [m] in S from the centre of mass and the attitude (3.7)."""
    n_c = s.foot_ref.shape[1]
    relative = model.feet(s.q_j) - ca.repmat(model.com(s.q_j), 1, n_c)
    return ca.repmat(s.r, 1, n_c) + s.R @ relative


def link_slopes(robot: Robot, model: BaseFrameModel, q_j: Expression, R: Expression) -> tuple[np.ndarray, Expression]:
    """Return the length ``(n_c,)`` [m] of the link that carries each contact point, and the sine ``(n_c,)`` of its slope."""
    q_0 = robot.poses["home"]
    lengths = np.linalg.norm(np.asarray(model.last_joints(q_0)) - np.asarray(model.feet(q_0)), axis=0)
    rise = (R @ (model.last_joints(q_j) - model.feet(q_j)))[2, :]
    lengths = np.maximum(lengths, _POINT)
    return lengths, rise.T / lengths
