"""The knots of the kino-dynamic stage: thesis (3.1)–(3.14), reduced to what is independent, with the flight in the problem.

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

from collections.abc import Iterable

import casadi as ca
import numpy as np

from aerial_model.robot.contact import friction_pyramid
from aerial_model.robot.robot import GRAVITY, Robot
from aerial_planner.codegen.library import FunctionLibrary
from aerial_planner.formulation.attitude import require_attitude
from aerial_planner.formulation.formulation import Formulation
from aerial_planner.formulation.knots import FlightKnot, TakeOffKnot, foot_velocities, link_slopes, world_feet
from aerial_planner.formulation.limits import Variant
from aerial_planner.kinematics.base_frame import BaseFrameModel, attitude_error
from aerial_planner.motion.schedule import Schedule, contact_bits
from aerial_planner.ocp.options import SolverOptions
from aerial_planner.ocp.stage import Rows, StageKind
from aerial_planner.settings import PlannerSettings


class KinoDynamicKinds(Formulation):
    """The kinds of knots that the kino-dynamic problems of one robot and variant are made of.

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
        # Of the whole robot, the joints that carry no contact: arms, which the flight moves, and held ones, which bear it.
        self._upper = np.union1d(robot.planned_joints[self.robot.arms], np.flatnonzero(robot.held_joints))

    def kinds(self, schedule: Schedule) -> list[StageKind]:
        """Return the stage kind of each knot."""
        sets = _contact_sets(schedule)
        ends = np.append(np.diff(schedule.phase) != 0, False)
        kinds = [self._take_off_kind(*pair, ends_phase=bool(end)) for pair, end in zip(sets, ends, strict=True)]
        kinds[-1] = self._take_off_kind(*sets[-1], last=True)
        kinds.append(self._lift_off_kind(sets[-1][1]))
        kinds += [self._flight_kind()] * (schedule.flight_knots - 1)
        return [*kinds, self._touchdown_kind()]

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
        kind = rows.stage(name, s.x, s.u, s.p, cost, s.step(robot.mass), **s.shorthands)
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
            T, omega, p = ca.SX.sym("T"), ca.SX.sym("omega", 3), ca.SX.sym("p", FlightKnot.n_parameters(robot))
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
        self._torque_rows(rows, range(self._whole.n_joints), ca.mtimes(s.flight_inertia, acceleration), s.margin)

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
        self._torque_rows(rows, joints, torque, margin)
        return ca.vertcat(ca.vec(inertia), settling, folding, margin)

    def _torque_rows(self, rows: Rows, joints: Iterable[int], torque: ca.SX, margin: ca.SX) -> None:
        """Add that the torques of some of the whole robot's joints keep to a share of their limits."""
        for row, joint in enumerate(joints):
            limit = float(self._whole.actuators.torque_max[joint]) * margin[row]
            rows.between(f"{self._whole.joint_names[joint]} torque", torque[row] / limit, -1.0, 1.0)

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
            require_attitude(rows, x[3:7], goal)
            self._kinds[key] = rows.stage("touchdown", x, ca.SX(0, 1), goal, ca.SX(0), None)
        return self._kinds[key]


def _contact_sets(schedule: Schedule) -> list[tuple[tuple[bool, ...] | None, tuple[bool, ...]]]:
    """Return for each take-off knot the points on their footholds (None at the first, whose state is given), and those loaded.

    A point is on its foothold if it bore load since the knot before, or bears it from now on.
    """
    rows = [tuple(bool(b) for b in row) for row in schedule.contact]
    standing = [tuple(bool(b) for b in row) for row in schedule.contact[1:] | schedule.contact[:-1]]
    return list(zip([None, *standing], rows, strict=True))
