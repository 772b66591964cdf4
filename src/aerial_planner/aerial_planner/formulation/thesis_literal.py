"""The kino-dynamic problem as the thesis writes it: every variable of (3.1) at every knot, one Opti problem, IPOPT/MUMPS.

Slow on purpose: it is the reference the reduced formulation is tested against, and the baseline of the benchmark. It
poses the same problem as ``kino_dynamic``: the same cost, discretization and limits, the flight and the inertia of the
joints included; only the attitude is a quaternion where the thesis has Euler angles, which a flip would drive through
their singularity. It shares with the reduced formulation the robot's own functions and where contact points stand.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import casadi as ca
import numpy as np

from aerial_model.robot.robot import GRAVITY, Robot
from aerial_planner.formulation.contacts import footholds, knot_contacts
from aerial_planner.formulation.knots import holding_joints, link_slopes, mean_com
from aerial_planner.formulation.leg_inertia import LegInertia, inertial_torque
from aerial_planner.formulation.limits import Variant
from aerial_planner.formulation.thesis_literal_variables import LiteralVariables
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.kinematics.quaternion import (
    attitude_error,
    conjugate,
    quaternion_product,
    quaternion_step,
    rotation_matrix,
)
from aerial_planner.motion.schedule import Schedule
from aerial_planner.reference.body import Reference
from aerial_planner.settings import PlannerSettings

_SAME_TURN = 0.5  # least q_goal · q of an attitude that is the goal's, not the one a full turn away


@dataclass(frozen=True, kw_only=True)
class LiteralSolution:
    """The trajectory that IPOPT found, and its figures."""

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
        reference: what (3.4) measures deviations from, and where the motion starts.
        guess: where to start; the legs' inertia is as there.
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
        self.variables = LiteralVariables.of(self.opti, robot, schedule)
        self._joint_accelerations()
        self._objective()
        self._dynamics()
        self._kinematics()
        self._contacts()
        self._limits()
        self._boundary()
        self._flight()
        self._formulation_time = time.perf_counter() - began

    def _joint_accelerations(self) -> None:
        """Set q̈_j on each interval, and in the second half of the last, as expressions of the rates."""
        dq_j, dt = self.variables.dq_j, self.schedule.dt
        gained = dq_j[:, :-1] - ca.horzcat(ca.MX(ca.DM(self.reference.start_joint_velocity)), dq_j[:, :-2])
        gained[:, -1] = dq_j[:, -1] - ca.sum2(dq_j[:, -3:-1]) / 2  # the rates at which the contacts end
        self.ddq_j = gained / dt
        self.ddq_j_end = (dq_j[:, -1] - dq_j[:, -2]) / (0.5 * dt)

    def _objective(self) -> None:
        """Minimize (3.4)."""
        v, w, ref, cost = self.variables, self.settings.weights, self.reference, ca.MX(0)
        for k in range(self.N):
            cost += w.com * ca.sumsqr(v.r[:, k] - ref.com[k])
            cost += w.com_velocity * ca.sumsqr(v.rdot[:, k] - ref.com_velocity[k])
            cost += w.orientation * ca.sumsqr(attitude_error(v.quaternion[:, k], _constant(ref.orientation[k])))
            cost += w.joint_position * ca.sumsqr(v.q_j[:, k] - ref.joint_position[k])
            cost += w.angular_velocity * ca.sumsqr(v.omega[:, k])
            cost += w.force * ca.sumsqr(v.f[:, k])
        cost += w.joint_velocity * ca.sumsqr(v.dq_j) + w.joint_acceleration * ca.sumsqr(self.ddq_j)
        cost += w.joint_acceleration * ca.sumsqr(self.ddq_j_end) + w.angular_velocity * ca.sumsqr(v.flight_omega)
        for k in range(1, self.M):
            turn = attitude_error(v.flight_quaternion[:, k], _constant(ref.flight_orientation[k]))
            cost += w.orientation * ca.sumsqr(turn)
        cost += w.flight_time * (v.flight_time - self.schedule.flight_time) ** 2
        self.cost = cost
        self.opti.minimize(cost)

    def _dynamics(self) -> None:
        """Add (3.5) and (3.6)."""
        v, dt, mass, subject_to = self.variables, self.schedule.dt, self.robot.mass, self.opti.subject_to
        for k in range(self.N):
            forces = ca.reshape(v.f[:, k], 3, -1)
            centre = mean_com(v.r[:, k], v.rdot[:, k], ca.MX(dt))
            levers = ca.reshape(v.c[:, k], 3, -1) - ca.repmat(centre, 1, self.robot.n_contacts)
            moment = ca.sum2(ca.cross(levers, forces, 1))
            subject_to(mass * v.rddot[:, k] == ca.sum2(forces) - ca.DM([0, 0, mass * GRAVITY]))  # (3.5)
            subject_to(v.alpha_dot[:, k] == moment)
            subject_to(v.base[:, k + 1] == v.base[:, k] + v.base_velocity[:, k] * dt)  # (3.6)
            step = quaternion_step(v.omega[:, k], ca.MX(dt))
            subject_to(v.quaternion[:, k + 1] == quaternion_product(v.quaternion[:, k], step))
            subject_to(v.q_j[:, k + 1] == v.q_j[:, k] + v.dq_j[:, k] * dt)
            subject_to(v.alpha[:, k + 1] == v.alpha[:, k] + v.alpha_dot[:, k] * dt)
            subject_to(v.r[:, k + 1] == v.r[:, k] + 0.5 * (v.rdot[:, k] + v.rdot[:, k + 1]) * dt)
            subject_to(v.rdot[:, k + 1] == v.rdot[:, k] + v.rddot[:, k] * dt)
        subject_to(v.rddot[:, self.N] == 0)  # the last knot's second derivatives act on nothing
        subject_to(v.alpha_dot[:, self.N] == 0)

    def _kinematics(self) -> None:
        """Add (3.7) and (3.8)."""
        v, n_c = self.variables, self.robot.n_contacts
        for k in range(self.N + 1):
            q_j, R = v.q_j[:, k], rotation_matrix(v.quaternion[:, k])
            self.opti.subject_to(v.r[:, k] == v.base[:, k] + R @ self.model.com(q_j))  # (3.7)
            self.opti.subject_to(v.c[:, k] == ca.vec(ca.repmat(v.base[:, k], 1, n_c) + R @ self.model.feet(q_j)))
            omega, dq_j, alpha = v.omega[:, k], v.dq_j[:, k], v.alpha[:, k]
            if k < self.N:
                R, q_j = self._middle(k)
                alpha = alpha + 0.5 * self.schedule.dt * v.alpha_dot[:, k]
            self.opti.subject_to(alpha == R @ self.model.angular_momentum(q_j, omega, dq_j))  # (3.8)

    def _middle(self, k: int) -> tuple[ca.MX, ca.MX]:
        """Return attitude and joint angles at mid-interval, where a step's mean rates are the rates."""
        v, half = self.variables, 0.5 * self.schedule.dt
        turned = quaternion_product(v.quaternion[:, k], quaternion_step(v.omega[:, k], ca.MX(half)))
        return rotation_matrix(turned), v.q_j[:, k] + half * v.dq_j[:, k]

    def _contacts(self) -> None:
        """Add (3.9) and (3.10), with the links that stand on the contact points."""
        contacts, feet = knot_contacts(self.schedule), footholds(self.schedule, self.reference)
        for k in range(self.N):
            if k > 0:
                self._positions(k, feet[k], contacts[k].at_foothold, links=True)
            self._forces(k, contacts[k].loaded)
        self._positions(self.N, feet[self.N], contacts[-1].loaded, links=False)
        self._forces(self.N, (False,) * self.robot.n_contacts)
        self._feet_leave_the_ground_at_rest()

    def _positions(self, k: int, feet: np.ndarray, at_foothold: tuple[bool, ...], *, links: bool) -> None:
        v, subject_to, least = self.variables, self.opti.subject_to, self.settings.link_slope
        R = rotation_matrix(v.quaternion[:, k])
        lengths, slopes = link_slopes(self.robot, self.model, v.q_j[:, k], R)
        for i in range(self.robot.n_contacts):
            point = v.c[3 * i : 3 * i + 3, k]
            height = point[2] - feet[i, 2]
            if at_foothold[i]:
                subject_to(point == feet[i])  # (3.9a)
            else:
                subject_to(height >= 0)  # (3.10)
            if links:
                subject_to((slopes[i] if at_foothold[i] else height / lengths[i] + slopes[i]) >= least)

    def _forces(self, k: int, loaded: tuple[bool, ...]) -> None:
        mu, settings, bounded, subject_to = (
            self.robot.friction_coefficient,
            self.settings,
            self.opti.bounded,
            self.opti.subject_to,
        )
        for i in range(self.robot.n_contacts):
            force = self.variables.f[3 * i : 3 * i + 3, k]
            if loaded[i]:
                subject_to(bounded(-mu * force[2], force[0], mu * force[2]))  # (3.9b)
                subject_to(bounded(-mu * force[2], force[1], mu * force[2]))  # (3.9c)
                subject_to(bounded(settings.force_min, force[2], settings.force_max))
            else:
                subject_to(force == 0)

    def _feet_leave_the_ground_at_rest(self) -> None:
        """Joints that hold a contact point keep it at rest up to the end; the others go on as before."""
        v, k = self.variables, self.N
        q_j = ca.MX.sym("q_j", self.robot.n_joints)
        J_com = ca.Function("J_com", [q_j], [ca.jacobian(self.model.com(q_j), q_j)])(v.q_j[:, k])
        J, feet, com = (g(v.q_j[:, k]) for g in (self.model.foot_jacobians, self.model.feet, self.model.com))
        R = rotation_matrix(v.quaternion[:, k])
        for i in np.flatnonzero(self.schedule.contact[-1]).tolist():
            rates = (J[3 * i : 3 * i + 3, :] - J_com) @ v.dq_j[:, k]
            turning = ca.cross(v.omega[:, k], feet[:, i] - com)
            self.opti.subject_to(R.T @ v.rdot[:, k] + turning + rates == 0)
        for joint in np.flatnonzero(~holding_joints(self.model, self.schedule.contact[-1].tolist())).tolist():
            going_on = 1.5 * v.dq_j[joint, k - 1] - 0.5 * v.dq_j[joint, k - 2]
            self.opti.subject_to(v.dq_j[joint, k] == going_on)

    def _limits(self) -> None:
        """Add the joints' ranges and (3.11)."""
        v, robot, settings, bounded = self.variables, self.robot, self.settings, self.opti.bounded
        low, high = robot.planning_range
        inertia = LegInertia.on_intervals(robot, self.guess)
        speed = settings.speed_margin * robot.actuators.no_load_speed
        for k in range(self.N + 1):
            if k > 0:
                self.opti.subject_to(bounded(low, v.q_j[:, k], high))
            if self.variant is not Variant.KD:
                self.opti.subject_to(bounded(-speed, v.dq_j[:, k], speed))  # (3.11a)
                if k < self.N:
                    self._actuators(k, inertia.joint[k], inertia.wrench_share[k])

    def _actuators(self, k: int, H_joint: np.ndarray, H_wrench: np.ndarray) -> None:
        v, law, share = self.variables, self.robot.actuators, self.settings.margin
        R, q_j = self._middle(k)
        if self.variant is Variant.AAKD_STAR:
            frozen = ca.DM(self.robot.frozen_joints.astype(float))
            q_j = frozen * self.reference.x_0[-self.robot.n_joints :] + (1 - frozen) * q_j
        force_B = R.T @ ca.reshape(v.f[:, k], 3, -1)
        torque = inertial_torque(
            _constant(H_joint), _constant(H_wrench), self.ddq_j[:, k], force_B, self.model.feet(q_j)
        )
        torque -= self.model.foot_jacobians(q_j).T @ ca.vec(force_B)  # (3.14)
        volts = ca.DM(law.volts_per_torque) * torque + ca.DM(law.volts_per_speed) * v.dq_j[:, k]
        self.opti.subject_to(self.opti.bounded(-share, torque / law.torque_max, share))  # (3.11b)
        self.opti.subject_to(self.opti.bounded(-share, volts / law.bus_voltage, share))  # (3.11c)

    def _boundary(self) -> None:
        """Add 𝒳_0 and 𝒳_N: the state at the start, and that the ballistic path ends at the goal."""
        v, T, subject_to = self.variables, self.variables.flight_time, self.opti.subject_to
        shortest, longest = self.schedule.flight_time_range
        subject_to(self.opti.bounded(shortest, T, longest))
        start = ca.vertcat(*(column[:, 0] for column in (v.r, v.rdot, v.alpha, v.quaternion, v.q_j)))
        subject_to(start == self.reference.x_0)
        landing = v.r[:, self.N] + v.rdot[:, self.N] * T - ca.vertcat(0, 0, 0.5 * GRAVITY * T**2)
        subject_to(landing == self.reference.landing_com)

    def _flight(self) -> None:
        """Add the flight: (3.8) with the legs on their path, and the attitude at touchdown."""
        v, path, subject_to = self.variables, self.reference.flight_path, self.opti.subject_to
        alpha = v.alpha[:, self.N]
        subject_to(v.flight_quaternion[:, 0] == v.quaternion[:, self.N])
        subject_to(v.flight_q_j[:, 0] == v.q_j[:, self.N])
        for k in range(self.M):
            share, fraction, *pose_ahead = path.parameters(k)
            dt = share * v.flight_time
            q_j, quaternion, omega = v.flight_q_j[:, k], v.flight_quaternion[:, k], v.flight_omega[:, k]
            step = fraction * (np.array(pose_ahead) - q_j)
            middle = rotation_matrix(quaternion_product(quaternion, quaternion_step(omega, 0.5 * dt)))
            momentum = self.model.angular_momentum(q_j + 0.5 * step, omega, step / dt)
            subject_to(middle.T @ alpha == momentum)
            turned = quaternion_product(quaternion, quaternion_step(omega, dt))
            subject_to(v.flight_quaternion[:, k + 1] == turned)
            subject_to(v.flight_q_j[:, k + 1] == q_j + step)
        goal = _constant(self.schedule.landing_orientation)
        error = quaternion_product(conjugate(goal), v.flight_quaternion[:, self.M])
        subject_to(error[:3] == 0)
        subject_to(error[3] >= _SAME_TURN)

    def solve(self, *, tolerance: float = 1e-4, max_iterations: int = 500) -> LiteralSolution:
        """Return the optimum near the guess."""
        self._set_initial(self.guess)
        options: dict[str, str | int | float] = {
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
            trajectory=self.variables.trajectory(solution, self.schedule.dt),
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
        values = self.variables.values(guess, self.model, self.robot.mass, self.schedule.dt)
        for variable, value in values:
            self.opti.set_initial(variable, value)


def _constant(array: np.ndarray) -> ca.MX:
    """Return numbers as an expression."""
    return ca.MX(ca.DM(array))
