"""The kino-dynamic stage: thesis (3.1)–(3.14), reduced to what is independent, with the flight in the problem.

Of the thesis's variables the centre of mass r, its velocity ṙ, the angular momentum α, the attitude and the joint angles
are the state; body rate ω, joint rates q̇_j and forces f the control. The base position follows from r, so (3.7) holds
by construction; accelerations and α̇ are expressions. What stays are the momentum agreement (3.8) and the fixed feet
(3.9a), as equalities of a knot.

    take-off knot   x = [r, ṙ, α, quaternion, q_j, q̇_j of the knot before],   u = [ω, q̇_j, f of the loaded contacts]
    its last        x as above,   u = [as above, q̇_j at which the contacts end, of the joints that hold them]
    lift-off knot   x as above, with these rates,   u = [ω in flight, ω on the ground, arms' q̇_j in flight, the flight time T]
    flight knot     x = [α, quaternion, q_j, T, arms' q̇_j of the knot before],   u = [ω, arms' q̇_j]

With timing optimized, x has the factor by which the phase's time steps differ from the schedule's, constant but for the
last knot of a phase, whose u sets that of the next; the cost of a knot is weighted with it, as an integral's would be.

The rates of the knot before give the joint accelerations: the torque limits then hold for −Jᵀf *and* the inertia of the
legs (``knots.LegInertia``) in the pose of the guess. With (3.14) alone, which neglects it, unloaded legs whip around for free and the last force
before lift-off becomes an impulse that no leg could follow.

In flight the legs follow a given path from the take-off pose through the tuck to the landing pose and turn the body
against them; because these knots are in the problem, the attitude at touchdown is the goal's, legs included. Arms, if
there are any, go where the angular momentum asks them to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import casadi as ca
import numpy as np

from aerial_model.contact import friction_pyramid
from aerial_model.robot import Robot
from aerial_planner.compiled import FunctionLibrary
from aerial_planner.formulation import Formulation
from aerial_planner.knots import (
    FlightKnot,
    LegInertia,
    TakeOffKnot,
    foot_velocities,
    holding_joints,
    link_slopes,
    world_feet,
)
from aerial_planner.reference import FlightPath, Reference
from aerial_planner.schedule import GRAVITY, Schedule, contact_bits
from aerial_planner.settings import PlannerSettings
from aerial_planner.solver import SolverOptions
from aerial_planner.stage import Rows, StageData, StageKind
from aerial_planner.symbolic import (
    BaseFrameModel,
    attitude_error,
)
from aerial_planner.trajectory import TakeOffTrajectory
from aerial_planner.transcription import Solution

_UNLIMITED = 1e3  # times the limit


class Variant(StrEnum):
    """Which actuator constraints a plan obeys (thesis section 3.1.3)."""

    KD = "KD"  # none
    AAKD = "AAKD"  # (3.11) with the exact contact Jacobian
    AAKD_STAR = "AAKD*"  # (3.11) with the Jacobian at frozen ab/adduction


@dataclass(frozen=True, kw_only=True)
class Margin:
    """Shares of torque and voltage limits that each joint may use ``(n,)``."""

    take_off: np.ndarray
    flight: np.ndarray  # of legs only as it begins

    @staticmethod
    def usual(robot: Robot, settings: PlannerSettings) -> Margin:
        """Return the settings'; in flight only arms', which are free: others usually have torque to spare there."""
        flight = np.full(robot.n_joints, _UNLIMITED)
        flight[robot.planned_joints[robot.planned.arms]] = settings.margin
        return Margin(take_off=np.full(robot.n_joints, settings.margin), flight=flight)


class KinoDynamic(Formulation):
    """Builds and solves the kino-dynamic problems of one robot and variant.

    Args:
        robot: the whole robot; those of its joints that plans leave at home appear only in the torque limits.
        model: expressions of ``robot.planned``.
        settings: of the planner.
        variant: which actuator constraints hold.
        options: of the solver.
        library: compiled functions; None: interpreted ones.
        timed: phase durations are optimized.
    """

    def __init__(
        self,
        robot: Robot,
        model: BaseFrameModel,
        settings: PlannerSettings,
        variant: Variant,
        options: SolverOptions,
        library: FunctionLibrary | None = None,
        *,
        timed: bool = False,
    ) -> None:
        super().__init__(robot.planned, model, settings, options, library)
        self._whole = robot
        self.variant = variant
        self.timed = timed
        # Joints that the flight moves, or that must hold on while others move: their torques are limited all the way.
        self._upper = np.union1d(robot.planned_joints[self.robot.arms], np.flatnonzero(robot.held_joints))

    def solve(
        self,
        schedule: Schedule,
        reference: Reference,
        guess: TakeOffTrajectory,
        *,
        near: bool = False,
        margin: Margin | None = None,
    ) -> tuple[TakeOffTrajectory, Solution]:
        """Return the optimum near ``guess`` and the solver's account of it; check the latter before using the former.

        Args:
            schedule: contacts and flight.
            reference: what (3.4) measures deviations from.
            guess: where to start.
            near: the guess is the optimum of a similar problem, and within its limits.
            margin: shares of torque and voltage limits that may be used; None: the settings'.
        """
        margin = self._usual_margin if margin is None else margin
        inertia = leg_inertia_along(self._whole, guess)
        solution = self.problem(schedule, near=near).solve(self._stages(schedule, reference, guess, margin, inertia))
        return self._trajectory(schedule, solution), solution

    def violation(
        self, schedule: Schedule, reference: Reference, trajectory: TakeOffTrajectory, guess: TakeOffTrajectory
    ) -> float:
        """Return by how much ``trajectory`` misses any constraint of the problem that starts at ``guess``, SI units."""
        inertia = leg_inertia_along(self._whole, guess)
        stages = self._stages(schedule, reference, trajectory, self._usual_margin, inertia)
        return self.problem(schedule).violation(stages)

    def kinds(self, schedule: Schedule) -> list[StageKind]:
        """Return the stage kind of each knot."""
        sets = _contact_sets(schedule)
        ends = np.append(np.diff(schedule.phase) != 0, False)
        kinds = [self._take_off_kind(*pair, ends_phase=bool(end)) for pair, end in zip(sets, ends, strict=True)]
        kinds[-1] = self._take_off_kind(*sets[-1], last=True)
        kinds.append(self._lift_off_kind(sets[-1][1]))
        kinds += [self._flight_kind()] * (schedule.flight_knots - 1)
        return [*kinds, self._touchdown_kind()]

    # --- stage kinds: variables, objective, dynamics, constraints ---------------------------------------------------

    def _take_off_kind(
        self,
        touching: tuple[bool, ...] | None,
        loaded: tuple[bool, ...],
        *,
        ends_phase: bool = False,
        last: bool = False,
    ) -> StageKind:
        """Return the knot whose ``touching`` contacts are held and ``loaded`` ones push; touching None: the first knot."""
        ends_phase = ends_phase and self.timed  # else it makes no difference
        key = ("take_off", touching, loaded, ends_phase, last)
        if key in self._kinds:
            return self._kinds[key]
        robot, settings = self.robot, self.settings
        n_c = robot.n_contacts
        s = TakeOffKnot(
            robot,
            self.model,
            loaded,
            n_whole=self._whole.n_joints,
            last=last,
            timed=self.timed,
            ends_phase=ends_phase,
        )

        dr = s.r - s.r_ref
        dv = s.rdot - s.rdot_ref
        turn = attitude_error(s.quaternion, s.quaternion_ref)
        dq = s.q_j - s.q_j_ref
        w = settings.weights
        cost = (
            w.com * ca.sumsqr(dr)
            + w.com_velocity * ca.sumsqr(dv)
            + w.orientation * ca.sumsqr(turn)
            + w.joint_position * ca.sumsqr(dq)
            + w.angular_velocity * ca.sumsqr(s.omega)
            + w.joint_velocity * ca.sumsqr(s.dq_j)
            + w.joint_acceleration * (ca.sumsqr(s.ddq_j) + ca.sumsqr(s.ddq_j_end))
            + w.force * ca.sumsqr(s.f)
        )
        if self.timed:
            cost *= s.stretch  # as an integral's share: else the longest time would be the cheapest

        rows = Rows()
        if touching is None:
            rows.equal("start", s.motion - s.x_0)
        else:
            feet = world_feet(self.model, s)
            lengths, slopes = link_slopes(robot, self.model, s.q_j, s.R)
            for i, axis in robot.holding_rows(touching):
                rows.equal("feet", feet[axis, i] - s.foot_ref[axis, i])  # (3.9a)
            links = robot.contact_links
            is_tip = [np.count_nonzero(links == link) == 1 for link in links]  # not one of the corners of a foot
            for i in range(n_c):
                if touching[i] and is_tip[i]:
                    rows.between("crouch", slopes[i], settings.link_slope, np.inf)
                if touching[i] or loaded[i]:
                    continue
                rows.between("ground", feet[2, i] - s.foot_ref[2, i], 0.0, np.inf)  # (3.10)
                if is_tip[i]:
                    # The link above the foot, too: its other end no lower than where it may stand on the foot.
                    rise = (feet[2, i] - s.foot_ref[2, i]) / lengths[i] + slopes[i]
                    rows.between("ground", rise, settings.link_slope, np.inf)
        rows.equal("momentum", s.momentum_gap(self.model))  # (3.8)
        pyramid = friction_pyramid(robot.friction_coefficient)[:4]
        for i in np.flatnonzero(loaded):
            rows.between("friction", ca.DM(pyramid) @ s.force[i], 0.0, np.inf)  # (3.9b, c)
        if self.variant is not Variant.KD:
            self._actuator_rows(rows, s, loaded)

        name = f"take_off_{contact_bits(touching)}_{contact_bits(loaded)}_{self._name}"
        name += "_last" if last else "_end" if ends_phase else ""
        kind = rows.stage(name, s.x, s.u, s.p, cost, s.step(robot.mass))
        self._kinds[key] = kind
        return kind

    @property
    def _name(self) -> str:
        return self.variant.name + ("_timed" if self.timed else "")

    def _actuator_rows(self, rows: Rows, s: TakeOffKnot, loaded: tuple[bool, ...]) -> None:
        """Add torque and voltage limits (3.11b, c) of all joints at mid-interval, with τ of (3.14) plus the legs' inertia."""
        whole, law, q_j = self._whole, self._whole.actuators, s.q_j_mid
        if self.variant is Variant.AAKD_STAR:
            frozen = ca.DM(self.robot.frozen_joints.astype(float))
            q_j = frozen * s.q_j_frozen + (1 - frozen) * q_j
        J = self.model.foot_jacobians(q_j)  # (3 n_c, n) in B
        pushing = np.flatnonzero(loaded)
        force_B = s.R_mid.T @ ca.horzcat(*(s.force[i] for i in pushing))
        torque = s.leg_inertia.torque(s.ddq_j, force_B, self.model.feet(q_j)[:, pushing.tolist()])
        planned = whole.planned_joints.tolist()
        speed = ca.SX(whole.n_joints, 1)
        speed[planned] = s.dq_j
        for column, i in enumerate(pushing):
            torque[planned] -= J[3 * i : 3 * i + 3, :].T @ force_B[:, column]  # (3.14)
        for joint, name in enumerate(whole.joint_names):
            rows.between(f"{name} torque", torque[joint] / law.torque_max[joint] / s.margin[joint], -1.0, 1.0)
            volts = law.volts_per_torque[joint] * torque[joint] + law.volts_per_speed[joint] * speed[joint]
            rows.between(f"{name} voltage", volts / law.bus_voltage[joint] / s.margin[joint], -1.0, 1.0)

    def _lift_off_kind(self, touching: tuple[bool, ...]) -> StageKind:
        """Return the knot at which the last contact ends: the ballistic path from here ends at the goal."""
        key = ("lift_off", touching)
        if key in self._kinds:
            return self._kinds[key]
        robot = self.robot
        s = TakeOffKnot(
            robot,
            self.model,
            (False,) * robot.n_contacts,
            n_whole=self._whole.n_joints,
            in_flight=True,
            timed=self.timed,
        )
        rows = Rows()
        feet = world_feet(self.model, s)
        holding = robot.holding_rows(touching)
        for i, axis in holding:
            rows.equal("feet", feet[axis, i] - s.foot_ref[axis, i])
        for i in range(robot.n_contacts):
            if not touching[i]:
                rows.between("ground", feet[2, i] - s.foot_ref[2, i], 0.0, np.inf)
        landing = s.r + s.flight_time * s.rdot - ca.vertcat(0, 0, 0.5 * GRAVITY * s.flight_time**2)
        rows.equal("landing position", landing - s.landing_com)
        flight = FlightKnot(
            robot,
            alpha=s.alpha,
            quaternion=s.quaternion,
            q_j=s.q_j,
            flight_time=s.flight_time,
            omega=s.omega,
            arm_rate=s.arm_rate,
            arm_rate_before=s.dq_before[robot.arms.tolist()],
            p=s.flight_p,
            first=True,
        )
        rows.equal("momentum", flight.momentum_gap(self.model))
        self._onset_rows(rows, s, flight)
        # The rates at which the feet leave the ground: without them the last force could be an impulse no leg follows.
        rows.equal("momentum", s.R.T @ s.alpha - self.model.angular_momentum(s.q_j, s.omega_ground, s.dq_before))
        slip = foot_velocities(self.model, s)
        for i, axis in holding:
            rows.equal("feet", slip[i][axis])
        w = self.settings.weights
        cost = (
            w.angular_velocity * ca.sumsqr(s.omega)
            + w.joint_velocity * ca.sumsqr(s.dq_before)
            + w.flight_time * (s.flight_time - s.flight_time_ref) ** 2
            + self._arm_cost(flight)
        )
        kind = rows.stage(f"lift_off_{contact_bits(touching)}_{self._name}", s.x, s.u, s.p, cost, flight.step())
        self._kinds[key] = kind
        return kind

    def _flight_kind(self) -> StageKind:
        key = ("flight",)
        if key not in self._kinds:
            robot = self.robot
            name = "flight" if len(robot.arms) == 0 else f"flight_{self.variant.name}"
            alpha, quaternion, q_j = ca.SX.sym("alpha", 3), ca.SX.sym("quat", 4), ca.SX.sym("q_j", robot.n_joints)
            T, omega, p = ca.SX.sym("T"), ca.SX.sym("omega", 3), ca.SX.sym("p", FlightKnot.n_p(robot))
            arm_rate, before = ca.SX.sym("arm_rate", len(robot.arms)), ca.SX.sym("before", len(robot.arms))
            quaternion_ref, w = ca.SX.sym("quat_ref", 4), self.settings.weights
            flight = FlightKnot(
                robot,
                alpha=alpha,
                quaternion=quaternion,
                q_j=q_j,
                flight_time=T,
                omega=omega,
                arm_rate=arm_rate,
                arm_rate_before=before,
                p=p,
            )
            rows = Rows()
            rows.equal("momentum", flight.momentum_gap(self.model))
            limits = self._upper_rows(rows, flight)
            self._kinds[key] = rows.stage(
                name,
                ca.vertcat(alpha, quaternion, q_j, T, before),
                ca.vertcat(omega, arm_rate),
                ca.vertcat(p, quaternion_ref, limits),
                w.angular_velocity * ca.sumsqr(omega)
                + w.orientation * ca.sumsqr(attitude_error(quaternion, quaternion_ref))
                + self._arm_cost(flight),
                flight.step(),
            )
        return self._kinds[key]

    def _onset_rows(self, rows: Rows, s: TakeOffKnot, flight: FlightKnot) -> None:
        """Add torque limits of all joints as the flight begins, when legs end the take-off's motion and set out to fold."""
        if self.variant is Variant.KD:
            return
        settling, folding = s.onset[0], s.onset[1] / s.flight_time**2
        acceleration = folding * (flight.target - s.q_j) - settling * s.dq_before
        arms = self.robot.arms.tolist()
        if arms:
            acceleration[arms] = flight.arm_acceleration
        torque = ca.mtimes(s.flight_inertia, acceleration)
        for joint, name in enumerate(self._whole.joint_names):
            limit = float(self._whole.actuators.torque_max[joint])
            rows.between(f"{name} torque", torque[joint] / limit / s.margin[joint], -1.0, 1.0)

    def _upper_rows(self, rows: Rows, flight: FlightKnot) -> ca.SX:
        """Add torque limits of the joints that carry no contact, in flight, if arms move; return their parameters.

        All that falls is without weight: what counts is the inertia of the arms, and that of the legs, which follow
        their path whatever the arms do: both at the guess, but for how fast the path is in a longer or shorter flight.
        """
        joints, n_a = self._upper, len(self.robot.arms)
        if self.variant is Variant.KD or n_a == 0:
            return ca.SX(0, 1)
        inertia, margin = ca.SX.sym("H_arms", len(joints), n_a), ca.SX.sym("margin", len(joints))
        settling, folding = ca.SX.sym("tau_settling", len(joints)), ca.SX.sym("tau_folding", len(joints))
        torque = settling + folding / flight.flight_time**2 + ca.mtimes(inertia, flight.arm_acceleration)
        for row, joint in enumerate(joints):
            limit = float(self._whole.actuators.torque_max[joint]) * margin[row]
            rows.between(f"{self._whole.joint_names[joint]} torque", torque[row] / limit, -1.0, 1.0)
        return ca.vertcat(ca.vec(inertia), settling, folding, margin)

    def _arm_cost(self, flight: FlightKnot) -> ca.SX:
        """Return the cost of how arms move: without one they would jump, in flight as on the ground."""
        w, arms = self.settings.weights, self.robot.arms.tolist()
        return (
            w.joint_position * ca.sumsqr((flight.q_j - flight.target)[arms])
            + w.joint_velocity * ca.sumsqr(flight.arm_rate)
            + w.joint_acceleration * ca.sumsqr(flight.arm_acceleration)
        )

    def _touchdown_kind(self) -> StageKind:
        key = ("touchdown",)
        if key not in self._kinds:
            x = ca.SX.sym("x", 8 + self.robot.n_joints + len(self.robot.arms))
            goal = ca.SX.sym("goal", 4)
            rows = Rows()
            rows.attitude(x[3:7], goal)
            self._kinds[key] = rows.stage("touchdown", x, ca.SX(0, 1), goal, ca.SX(0), None)
        return self._kinds[key]

    # --- numbers of one request -------------------------------------------------------------------------------------

    def _stages(
        self,
        schedule: Schedule,
        reference: Reference,
        guess: TakeOffTrajectory,
        margin: Margin,
        inertia: Sequence[LegInertia],
    ) -> list[StageData]:
        knots = self._take_off_stages(schedule, reference, guess, margin, inertia)
        return [*knots, *self._flight_stages(schedule, reference, guess, margin)]

    @property
    def _usual_margin(self) -> Margin:
        return Margin.usual(self._whole, self.settings)

    @property
    def _speed(self) -> np.ndarray:
        """Greatest joint speeds ``(n,)`` [rad/s] (3.11a)."""
        if self.variant is Variant.KD:
            return np.full(self.robot.n_joints, np.inf)
        return self.settings.speed_margin * self.robot.actuators.no_load_speed

    def _take_off_stages(
        self,
        schedule: Schedule,
        reference: Reference,
        guess: TakeOffTrajectory,
        margin: Margin,
        inertia: Sequence[LegInertia],
    ) -> list[StageData]:
        """Return the numbers of the knots on the ground, the lift-off's included."""
        robot, settings = self.robot, self.settings
        n, N = robot.n_joints, len(schedule.contact)
        low, high = robot.planning_range
        x_min = np.tile(np.concatenate([np.full(13, -np.inf), low, np.full(n, -np.inf)]), (N + 1, 1))
        x_max = np.tile(np.concatenate([np.full(13, np.inf), high, np.full(n, np.inf)]), (N + 1, 1))
        x_min[0], x_max[0] = -np.inf, np.inf  # where the robot stands is given
        speed = self._speed
        holding = holding_joints(self.model, schedule.contact[-1])
        x_min[N, 13 + n :], x_max[N, 13 + n :] = -speed, speed
        before = np.vstack([np.zeros(n), guess.joint_velocity[: N - 1], guess.joint_velocity[-1]])
        x = np.hstack(
            [guess.com, guess.com_velocity, guess.angular_momentum, guess.orientation, guess.joint_position, before]
        )
        stretch, least, greatest = self._stretches(schedule, guess)  # (N+1, 0 or 1) each
        x, x_min, x_max = np.hstack([x, stretch]), np.hstack([x_min, least]), np.hstack([x_max, greatest])
        ends = np.append(np.diff(schedule.phase) != 0, False)
        ground = np.tile(reference.foot_position, (N + 1, 1, 1))  # and above which height feet in the air must be
        ground[..., 2] += reference.foot_clearance
        stages = []
        for k in range(N):
            loaded = schedule.contact[k]
            n_f = int(loaded.sum())
            p = [[schedule.dt], reference.com[k], reference.com_velocity[k], reference.orientation[k]]
            p += [
                reference.joint_position[k],
                reference.x_0[-n:],
                ground[k].ravel(),
                reference.x_0,
                np.zeros(n),
                margin.take_off,
                inertia[k].parameters,
            ]
            u = [guess.angular_velocity[k], guess.joint_velocity[k], guess.force[k][loaded].ravel()]
            force_min = np.tile([-np.inf, -np.inf, settings.force_min], n_f)
            force_max = np.tile([np.inf, np.inf, settings.force_max], n_f)
            u_min, u_max = [np.full(3, -np.inf), -speed, force_min], [np.full(3, np.inf), speed, force_max]
            if k == N - 1:
                free = np.full(holding.sum(), np.inf)
                u, u_min, u_max = [*u, guess.joint_velocity[-1][holding]], [*u_min, -free], [*u_max, free]
            elif ends[k]:
                u, u_min, u_max = [*u, stretch[k + 1]], [*u_min, least[k + 1]], [*u_max, greatest[k + 1]]
            stages.append(
                StageData(
                    p=np.concatenate(p),
                    x=x[k],
                    x_min=x_min[k],
                    x_max=x_max[k],
                    u=np.concatenate(u),
                    u_min=np.concatenate(u_min),
                    u_max=np.concatenate(u_max),
                )
            )
        path = reference.flight_path
        p = [
            *([schedule.dt], ground[N].ravel(), [schedule.flight_time], reference.landing_com, path.parameters(0)),
            *(margin.flight, LegInertia.at(self._whole, guess.joint_position[-1]).joint.ravel(order="F")),
            path.onset(schedule.flight_time),
        ]
        bounds = {"x_min": x_min[N], "x_max": x_max[N]}
        return [
            *stages,
            self._lift_off_stage(schedule, guess, np.concatenate(p), x[N], bounds),
        ]

    def _lift_off_stage(
        self, schedule: Schedule, guess: TakeOffTrajectory, p: np.ndarray, x: np.ndarray, bounds: dict[str, np.ndarray]
    ) -> StageData:
        arms, speed = self.robot.arms, self._speed
        shortest, longest = schedule.flight_time_range
        u = [
            guess.flight_angular_velocity[0],
            guess.angular_velocity[-1],
            self._arm_rates(guess)[0],
            [guess.flight_time],
        ]
        u_min = np.concatenate([np.full(6, -np.inf), -speed[arms], [shortest]])
        u_max = np.concatenate([np.full(6, np.inf), speed[arms], [longest]])
        return StageData(p=p, x=x, u=np.concatenate(u), u_min=u_min, u_max=u_max, **bounds)

    def _arm_rates(self, guess: TakeOffTrajectory) -> np.ndarray:
        """Return the arms' mean rates on each interval of the flight ``(M, n_a)`` [rad/s]."""
        steps = np.diff(guess.flight_joint_position[:, self.robot.arms], axis=0)
        return steps * len(steps) / guess.flight_time

    def _upper_limits(self, path: FlightPath, guess: TakeOffTrajectory, margin: Margin) -> np.ndarray:
        """Return the parameters of ``_upper_rows`` of each flight knot ``(M, n)``, the first one's unused."""
        M, joints, arms = len(path.fraction), self._upper, self.robot.arms
        if self.variant is Variant.KD or len(arms) == 0:
            return np.zeros((M, 0))
        legs = np.setdiff1d(np.arange(self.robot.n_joints), arms)
        dt = guess.flight_time / M
        middle = (np.arange(M) + 0.5) * dt
        start, T = guess.joint_position[-1], guess.flight_time
        _, rate = path.at(start, middle, T)
        _, both = path.from_take_off(start, guess.joint_velocity[-1], middle, T)
        limits = []
        for k in range(M):
            inertia = LegInertia.at(self._whole, guess.flight_joint_position[k]).joint[joints]
            before = max(k - 1, 0)
            folding, total = (rate[k] - rate[before]) / dt, (both[k] - both[before]) / dt
            torques = inertia[:, legs] @ (total - folding)[legs], inertia[:, legs] @ folding[legs] * T**2
            limits.append(np.concatenate([inertia[:, arms].ravel(order="F"), *torques, margin.flight[joints]]))
        return np.array(limits)

    def _flight_stages(
        self, schedule: Schedule, reference: Reference, guess: TakeOffTrajectory, margin: Margin
    ) -> list[StageData]:
        """Return the numbers of the knots from the first in the air to touchdown."""
        n, M, arms, speed = self.robot.n_joints, schedule.flight_knots, self.robot.arms, self._speed
        low, high = self.robot.planning_range
        path, arm_rate, T = reference.flight_path, self._arm_rates(guess), [guess.flight_time]
        flight = np.hstack([guess.flight_orientation, guess.flight_joint_position])
        x_min, x_max = (np.full(8 + n + len(arms), bound) for bound in (-np.inf, np.inf))
        x_min[7 + arms], x_max[7 + arms] = low[arms], high[arms]
        bounds = {"x_min": x_min, "x_max": x_max}
        limits = self._upper_limits(path, guess, margin)
        stages = []
        for k in range(1, M + 1):
            x_k = np.concatenate([guess.angular_momentum[-1], flight[k], T, arm_rate[k - 1]])
            if k < M:
                p = np.concatenate([path.parameters(k), reference.flight_orientation[k], limits[k]])
                u = np.concatenate([guess.flight_angular_velocity[k], arm_rate[k]])
                u_min = np.concatenate([np.full(3, -np.inf), -speed[arms]])
                stages.append(StageData.free(p=p, x=x_k, u=u, u_min=u_min, u_max=-u_min, **bounds))
            else:
                stages.append(StageData.free(p=schedule.aim, x=x_k, **bounds))
        return stages

    def _stretches(self, schedule: Schedule, guess: TakeOffTrajectory) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return guess and bounds of the factor of the time steps at each take-off knot; without columns if fixed."""
        if not self.timed:
            return (np.zeros((len(schedule.contact) + 1, 0)),) * 3
        least, greatest = np.vstack([schedule.stretch_range, schedule.stretch_range[-1:]]).T[..., None]
        stretch = np.append(guess.dt, guess.dt[-1])[:, None] / schedule.dt
        return np.clip(stretch, least, greatest), least, greatest

    def _trajectory(self, schedule: Schedule, solution: Solution) -> TakeOffTrajectory:
        n = self.robot.n_joints
        N = len(schedule.contact)
        x = np.array(solution.x[: N + 1])
        force = np.zeros((N, self.robot.n_contacts, 3))
        for k in range(N):
            force[k][schedule.contact[k]] = solution.u[k][3 + n :][: 3 * schedule.contact[k].sum()].reshape(-1, 3)
        flight = np.array([x[N][6 : 13 + n], *(x_k[: 7 + n] for x_k in solution.x[N + 1 :])])
        return TakeOffTrajectory(
            dt=schedule.dt * (x[:N, -1] if self.timed else np.ones(N)),
            com=x[:, :3],
            com_velocity=x[:, 3:6],
            angular_momentum=x[:, 6:9],
            orientation=x[:, 9:13],
            joint_position=x[:, 13 : 13 + n],
            angular_velocity=np.array([u[:3] for u in solution.u[:N]] + [solution.u[N][3:6]]),
            joint_velocity=np.array([u[3 : 3 + n] for u in solution.u[:N]] + [x[N, 13 + n : 13 + 2 * n]]),
            flight_time=float(solution.u[N][-1]),
            force=force,
            flight_orientation=flight[:, 3:7],
            flight_joint_position=flight[:, 7:],
            flight_angular_velocity=np.array([u[:3] for u in solution.u[N : N + schedule.flight_knots]]),
        )


def leg_inertia_along(robot: Robot, guess: TakeOffTrajectory) -> list[LegInertia]:
    """Return what the torque limits count of the legs' inertia on each take-off interval: its value at the guess."""
    middle = 0.5 * (guess.joint_position[:-1] + guess.joint_position[1:])
    return [LegInertia.at(robot, q_j) for q_j in middle]


def _contact_sets(schedule: Schedule) -> list[tuple[tuple[bool, ...] | None, tuple[bool, ...]]]:
    """Return for each take-off knot the contacts held since the knot before (None at the first) and those loaded."""
    rows = [tuple(bool(b) for b in row) for row in schedule.contact]
    return [(None if k == 0 else rows[k - 1], rows[k]) for k in range(len(rows))]
