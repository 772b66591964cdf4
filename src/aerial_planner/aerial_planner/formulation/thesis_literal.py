"""The kino-dynamic problem as the thesis writes it: every variable of (3.1) at every knot, one Opti problem, IPOPT/MUMPS.

Slow on purpose: it is the reference the reduced formulation is tested against, and the baseline of the benchmark. It
poses the same problem as ``kino_dynamic``: the same cost, discretization and limits, the flight and the inertia of the
joints included; only the attitude is a quaternion where the thesis has Euler angles, which a flip would drive through
their singularity. Nothing of the reduced formulation but the robot's own functions is used.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import casadi as ca
import numpy as np

from aerial_model.numerics import rotation
from aerial_model.robot.robot import GRAVITY, Robot
from aerial_planner.formulation.kino_dynamic import leg_inertia_along
from aerial_planner.formulation.knots import holding_joints, link_slopes, mean_com
from aerial_planner.formulation.limits import Variant
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.kinematics.base_frame import (
    BaseFrameModel,
    attitude_error,
    quaternion_product,
    quaternion_step,
    rotation_matrix,
)
from aerial_planner.motion.schedule import Schedule
from aerial_planner.reference.body import Reference
from aerial_planner.settings import PlannerSettings


@dataclass(frozen=True, kw_only=True)
class LiteralSolution:
    """What IPOPT found, and what it took."""

    trajectory: TakeOffTrajectory
    cost: float
    iterations: int
    converged: bool
    construction_time: float  # of the Opti problem and IPOPT's derivatives [s]
    solve_time: float  # [s]


class LiteralProblem:
    """One instance of (3.1); like the thesis's, it is built anew for every request.

    Args:
        robot: that jumps.
        model: its base-frame functions.
        settings: weights and margins, as for the reduced formulation.
        variant: which actuator constraints to obey.
        schedule: contacts and flight.
        reference: what (3.4) measures deviations from.
        guess: where to start; the legs' inertia is what it is there.
    """

    def __init__(
        self,
        robot: Robot,
        model: BaseFrameModel,
        settings: PlannerSettings,
        variant: Variant,
        schedule: Schedule,
        reference: Reference,
        guess: TakeOffTrajectory,
    ) -> None:
        began = time.perf_counter()
        self.robot, self.model, self.settings, self.variant = robot, model, settings, variant
        self.schedule, self.reference, self.guess = schedule, reference, guess
        self.N, self.M = len(schedule.contact), schedule.flight_knots
        self.opti = ca.Opti()
        self._variables()
        self._objective()
        self._dynamics()
        self._kinematics()
        self._contacts()
        self._limits()
        self._boundary()
        self._flight()
        self._formulation_time = time.perf_counter() - began

    def _variables(self) -> None:
        n, n_c, K, variable = self.robot.n_joints, self.robot.n_contacts, self.N + 1, self.opti.variable
        self.base, self.quaternion, self.q_j = variable(3, K), variable(4, K), variable(n, K)  # q
        self.base_velocity, self.omega, self.dq_j = variable(3, K), variable(3, K), variable(n, K)  # q̇
        self.r, self.rdot, self.rddot = variable(3, K), variable(3, K), variable(3, K)
        self.alpha, self.alpha_dot = variable(3, K), variable(3, K)
        self.c, self.f = variable(3 * n_c, K), variable(3 * n_c, K)
        self.flight_quaternion, self.flight_q_j = variable(4, self.M + 1), variable(n, self.M + 1)
        self.flight_omega, self.flight_time = variable(3, self.M), variable()
        self.R = [rotation_matrix(self.quaternion[:, k]) for k in range(K)]
        gained = self.dq_j[:, :-1] - ca.horzcat(ca.DM(self.reference.start_joint_velocity), self.dq_j[:, :-2])
        gained[:, -1] = self.dq_j[:, -1] - ca.sum2(self.dq_j[:, -3:-1]) / 2  # the rates at which the contacts end
        self.ddq_j = gained / self.schedule.dt  # on each interval
        self.ddq_j_end = (self.dq_j[:, -1] - self.dq_j[:, -2]) / (0.5 * self.schedule.dt)

    def _objective(self) -> None:
        w, ref, cost = self.settings.weights, self.reference, ca.MX(0)
        for k in range(self.N):
            cost += w.com * ca.sumsqr(self.r[:, k] - ref.com[k])
            cost += w.com_velocity * ca.sumsqr(self.rdot[:, k] - ref.com_velocity[k])
            cost += w.orientation * ca.sumsqr(attitude_error(self.quaternion[:, k], ca.DM(ref.orientation[k])))
            cost += w.joint_position * ca.sumsqr(self.q_j[:, k] - ref.joint_position[k])
            cost += w.angular_velocity * ca.sumsqr(self.omega[:, k])
            cost += w.force * ca.sumsqr(self.f[:, k])
        cost += w.joint_velocity * ca.sumsqr(self.dq_j) + w.joint_acceleration * ca.sumsqr(self.ddq_j)
        cost += w.joint_acceleration * ca.sumsqr(self.ddq_j_end) + w.angular_velocity * ca.sumsqr(self.flight_omega)
        for k in range(1, self.M):
            turn = attitude_error(self.flight_quaternion[:, k], ca.DM(ref.flight_orientation[k]))
            cost += w.orientation * ca.sumsqr(turn)
        cost += w.flight_time * (self.flight_time - self.schedule.flight_time) ** 2
        self.cost = cost
        self.opti.minimize(cost)

    def _dynamics(self) -> None:
        dt, mass, subject_to = self.schedule.dt, self.robot.mass, self.opti.subject_to
        for k in range(self.N):
            forces = ca.reshape(self.f[:, k], 3, -1)
            centre = mean_com(self.r[:, k], self.rdot[:, k], dt)
            levers = ca.reshape(self.c[:, k], 3, -1) - ca.repmat(centre, 1, self.robot.n_contacts)
            moment = sum(ca.cross(levers[:, i], forces[:, i]) for i in range(self.robot.n_contacts))
            subject_to(mass * self.rddot[:, k] == ca.sum2(forces) - ca.DM([0, 0, mass * GRAVITY]))  # (3.5)
            subject_to(self.alpha_dot[:, k] == moment)
            subject_to(self.base[:, k + 1] == self.base[:, k] + self.base_velocity[:, k] * dt)  # (3.6)
            step = quaternion_step(self.omega[:, k], dt)
            subject_to(self.quaternion[:, k + 1] == quaternion_product(self.quaternion[:, k], step))
            subject_to(self.q_j[:, k + 1] == self.q_j[:, k] + self.dq_j[:, k] * dt)
            subject_to(self.alpha[:, k + 1] == self.alpha[:, k] + self.alpha_dot[:, k] * dt)
            subject_to(self.r[:, k + 1] == self.r[:, k] + 0.5 * (self.rdot[:, k] + self.rdot[:, k + 1]) * dt)
            subject_to(self.rdot[:, k + 1] == self.rdot[:, k] + self.rddot[:, k] * dt)
        subject_to(self.rddot[:, self.N] == 0)  # the last knot's second derivatives act on nothing
        subject_to(self.alpha_dot[:, self.N] == 0)

    def _kinematics(self) -> None:
        for k in range(self.N + 1):
            q_j, R = self.q_j[:, k], self.R[k]
            self.opti.subject_to(self.r[:, k] == self.base[:, k] + R @ self.model.com(q_j))  # (3.7)
            feet = ca.repmat(self.base[:, k], 1, self.robot.n_contacts) + R @ self.model.feet(q_j)
            self.opti.subject_to(self.c[:, k] == ca.vec(feet))
            omega, dq_j, alpha = self.omega[:, k], self.dq_j[:, k], self.alpha[:, k]
            if k < self.N:
                R, q_j = self._middle(k)
                alpha = alpha + 0.5 * self.schedule.dt * self.alpha_dot[:, k]
            self.opti.subject_to(alpha == R @ self.model.angular_momentum(q_j, omega, dq_j))  # (3.8)

    def _middle(self, k: int) -> tuple[ca.MX, ca.MX]:
        """Return attitude and joint angles at mid-interval, where a step's mean rates are the rates."""
        half = 0.5 * self.schedule.dt
        turned = quaternion_product(self.quaternion[:, k], quaternion_step(self.omega[:, k], half))
        return rotation_matrix(turned), self.q_j[:, k] + half * self.dq_j[:, k]

    def _contacts(self) -> None:
        mu, subject_to = self.robot.friction_coefficient, self.opti.subject_to
        feet = self.reference.foot_position
        for k in range(self.N + 1):
            lengths, slopes = link_slopes(self.robot, self.model, self.q_j[:, k], self.R[k])
            for i in range(self.robot.n_contacts):
                rows = slice(3 * i, 3 * i + 3)
                loaded = k < self.N and self.schedule.contact[k, i]
                held = k > 0 and (self.schedule.contact[k - 1, i] or loaded)
                if held:
                    subject_to(self.c[rows, k] == feet[k, i])  # (3.9a)
                    if k < self.N:
                        subject_to(slopes[i] >= self.settings.link_slope)
                elif not loaded and k > 0:
                    rise = self.c[3 * i + 2, k] - feet[k, i, 2] - self.reference.foot_clearance[k, i]
                    subject_to(rise >= 0)  # (3.10)
                    if k < self.N:
                        subject_to(rise / lengths[i] + slopes[i] >= self.settings.link_slope)
                force = self.f[rows, k]
                if loaded:
                    subject_to(self.opti.bounded(-mu * force[2], force[0], mu * force[2]))  # (3.9b)
                    subject_to(self.opti.bounded(-mu * force[2], force[1], mu * force[2]))  # (3.9c)
                    subject_to(self.opti.bounded(self.settings.force_min, force[2], self.settings.force_max))
                else:
                    subject_to(force == 0)
        self._feet_leave_the_ground_at_rest()

    def _feet_leave_the_ground_at_rest(self) -> None:
        """Joints that hold a contact point keep it at rest up to the end; the others go on as before."""
        q_j, k = ca.MX.sym("q_j", self.robot.n_joints), self.N
        J_com = ca.Function("J_com", [q_j], [ca.jacobian(self.model.com(q_j), q_j)])(self.q_j[:, k])
        J, feet, com = (g(self.q_j[:, k]) for g in (self.model.foot_jacobians, self.model.feet, self.model.com))
        for i in np.flatnonzero(self.schedule.contact[-1]):
            rates = (J[3 * i : 3 * i + 3, :] - J_com) @ self.dq_j[:, k]
            turning = ca.cross(self.omega[:, k], feet[:, i] - com)
            self.opti.subject_to(self.R[k].T @ self.rdot[:, k] + turning + rates == 0)
        for joint in np.flatnonzero(~holding_joints(self.model, self.schedule.contact[-1])):
            going_on = 1.5 * self.dq_j[joint, k - 1] - 0.5 * self.dq_j[joint, k - 2]
            self.opti.subject_to(self.dq_j[joint, k] == going_on)

    def _limits(self) -> None:
        robot, settings, law = self.robot, self.settings, self.robot.actuators
        low, high = robot.planning_range
        inertia = leg_inertia_along(robot, self.guess)
        frozen = ca.DM(robot.frozen_joints.astype(float))
        start = self.reference.x_0[-robot.n_joints :]
        for k in range(self.N + 1):
            if k > 0:
                self.opti.subject_to(self.opti.bounded(low, self.q_j[:, k], high))
            if self.variant is Variant.KD:
                continue
            speed = settings.speed_margin * law.no_load_speed
            self.opti.subject_to(self.opti.bounded(-speed, self.dq_j[:, k], speed))  # (3.11a)
            if k == self.N:
                continue
            R, q_j = self._middle(k)
            if self.variant is Variant.AAKD_STAR:
                q_j = frozen * start + (1 - frozen) * q_j
            force_B = R.T @ ca.reshape(self.f[:, k], 3, -1)
            torque = inertia[k].torque(self.ddq_j[:, k], force_B, self.model.feet(q_j))
            torque -= self.model.foot_jacobians(q_j).T @ ca.vec(force_B)  # (3.14)
            share = settings.margin
            volts = ca.DM(law.volts_per_torque) * torque + ca.DM(law.volts_per_speed) * self.dq_j[:, k]
            self.opti.subject_to(self.opti.bounded(-share, torque / law.torque_max, share))  # (3.11b)
            self.opti.subject_to(self.opti.bounded(-share, volts / law.bus_voltage, share))  # (3.11c)

    def _boundary(self) -> None:
        x_0, T = self.reference.x_0, self.flight_time
        self.opti.subject_to(
            self.opti.bounded(self.schedule.flight_time_range[0], T, self.schedule.flight_time_range[1])
        )
        start = ca.vertcat(*(v[:, 0] for v in (self.r, self.rdot, self.alpha, self.quaternion, self.q_j)))
        self.opti.subject_to(start == x_0)  # 𝒳_0
        r, rdot = self.r[:, self.N], self.rdot[:, self.N]
        landing = r + rdot * T - ca.vertcat(0, 0, 0.5 * GRAVITY * T**2)
        self.opti.subject_to(landing == self.reference.landing_com)  # 𝒳_N

    def _flight(self) -> None:
        path, subject_to = self.reference.flight_path, self.opti.subject_to
        alpha = self.alpha[:, self.N]
        subject_to(self.flight_quaternion[:, 0] == self.quaternion[:, self.N])
        subject_to(self.flight_q_j[:, 0] == self.q_j[:, self.N])
        for k in range(self.M):
            parameters = path.parameters(k)
            dt, fraction, target = parameters[0] * self.flight_time, parameters[1], parameters[2:]
            q_j, quaternion, omega = self.flight_q_j[:, k], self.flight_quaternion[:, k], self.flight_omega[:, k]
            step = fraction * (target - q_j)
            middle = rotation_matrix(quaternion_product(quaternion, quaternion_step(omega, 0.5 * dt)))
            momentum = self.model.angular_momentum(q_j + 0.5 * step, omega, step / dt)
            subject_to(middle.T @ alpha == momentum)
            turned = quaternion_product(quaternion, quaternion_step(omega, dt))
            subject_to(self.flight_quaternion[:, k + 1] == turned)
            subject_to(self.flight_q_j[:, k + 1] == q_j + step)
        goal = self.schedule.landing_orientation
        conjugate_goal = ca.DM([-goal[0], -goal[1], -goal[2], goal[3]])
        error = quaternion_product(conjugate_goal, self.flight_quaternion[:, self.M])
        subject_to(error[:3] == 0)
        subject_to(error[3] >= 0.5)

    def solve(self, *, tolerance: float = 1e-4, max_iterations: int = 500) -> LiteralSolution:
        """Return the optimum near the guess."""
        self._set_initial(self.guess)
        options = {
            "print_level": 0,
            "sb": "yes",
            "tol": tolerance,
            "max_iter": max_iterations,
            "linear_solver": "mumps",
        }
        began = time.perf_counter()
        self.opti.solver("ipopt", {"print_time": False, "record_time": True, "error_on_fail": False}, options)
        solution = self.opti.solve_limited()  # makes IPOPT's derivatives first
        taken = time.perf_counter() - began
        stats = solution.stats()
        solving = float(stats["t_wall_total"])
        return LiteralSolution(
            trajectory=self._trajectory(solution),
            cost=float(solution.value(self.cost)),
            iterations=int(stats["iter_count"]),
            converged=bool(stats["success"]),
            construction_time=self._formulation_time + taken - solving,
            solve_time=solving,
        )

    def violation(self, trajectory: TakeOffTrajectory) -> float:
        """Return by how much ``trajectory`` misses any constraint of (3.1), SI units."""
        self._set_initial(trajectory)
        opti = self.opti
        g, lower, upper = (np.asarray(opti.value(v, opti.initial())).ravel() for v in (opti.g, opti.lbg, opti.ubg))
        return float(max(np.max(lower - g), np.max(g - upper)))

    def _set_initial(self, guess: TakeOffTrajectory) -> None:
        n_c, N, set_initial = self.robot.n_contacts, self.N, self.opti.set_initial
        R = rotation.matrix(guess.orientation)
        com_B = np.asarray(self.model.com.map(N + 1)(guess.joint_position.T)).T
        base = guess.com - np.einsum("kab,kb->ka", R, com_B)
        feet = np.asarray(self.model.feet.map(N + 1)(guess.joint_position.T)).T.reshape(N + 1, n_c, 3)
        positions = base[:, None] + np.einsum("kab,kib->kia", R, feet)
        force = np.concatenate([guess.force, np.zeros((1, n_c, 3))])
        rddot = force.sum(axis=1) / self.robot.mass - [0.0, 0.0, GRAVITY]
        rddot[-1] = 0.0
        centre = np.array(
            [mean_com(r, rdot, self.schedule.dt) for r, rdot in zip(guess.com, guess.com_velocity, strict=True)]
        )[..., 0]
        velocity = np.diff(base, axis=0) / self.schedule.dt
        values = {
            self.base: base,
            self.quaternion: guess.orientation,
            self.q_j: guess.joint_position,
            self.base_velocity: np.vstack([velocity, velocity[-1:]]),
            self.omega: guess.angular_velocity,
            self.dq_j: guess.joint_velocity,
            self.r: guess.com,
            self.rdot: guess.com_velocity,
            self.rddot: rddot,
            self.alpha: guess.angular_momentum,
            self.alpha_dot: np.cross(positions - centre[:, None], force).sum(axis=1),
            self.c: positions.reshape(N + 1, -1),
            self.f: force.reshape(N + 1, -1),
            self.flight_quaternion: guess.flight_orientation,
            self.flight_q_j: guess.flight_joint_position,
            self.flight_omega: guess.flight_angular_velocity,
        }
        for variable, value in values.items():
            set_initial(variable, value.T)
        set_initial(self.flight_time, guess.flight_time)

    def _trajectory(self, solution: ca.OptiSol) -> TakeOffTrajectory:
        def rows(variable: ca.MX) -> np.ndarray:
            return np.atleast_2d(solution.value(variable)).T

        return TakeOffTrajectory(
            dt=np.full(self.N, self.schedule.dt),
            com=rows(self.r),
            com_velocity=rows(self.rdot),
            angular_momentum=rows(self.alpha),
            orientation=rows(self.quaternion),
            joint_position=rows(self.q_j),
            angular_velocity=rows(self.omega),
            joint_velocity=rows(self.dq_j),
            force=rows(self.f)[:-1].reshape(self.N, self.robot.n_contacts, 3),
            flight_time=float(solution.value(self.flight_time)),
            flight_orientation=rows(self.flight_quaternion),
            flight_joint_position=rows(self.flight_q_j),
            flight_angular_velocity=rows(self.flight_omega),
        )
