"""The stage kinds of the kino-dynamic problem: thesis (3.1)–(3.14), reduced to what is independent, the flight included.

Of the thesis's variables the centre of mass r, its velocity ṙ, the angular momentum α, the attitude and the joint angles
are the state; body rate ω, joint rates q̇_j and forces f the control. The base position follows from r, so (3.7) holds
by construction; accelerations and α̇ are expressions. What stays are the momentum agreement (3.8) and the fixed feet
(3.9a), as equalities of a knot.

    take-off knot   x = [r, ṙ, α, quaternion, q_j, q̇_j of the interval before],   u = [ω, q̇_j, f of the loaded contacts]
    its last        x as above,   u = [as above, q̇_j at which the contacts end, of the joints that hold them]
    lift-off knot   x as above, with these rates,   u = [ω in flight, ω on the ground, arms' q̇_j in flight, the flight time T]
    flight knot     x = [α, quaternion, q_j, T, arms' q̇_j of the interval before],   u = [ω, arms' q̇_j]

``kino_dynamic_layouts`` declares them. With timing optimized, x has the factor by which the phase's time steps differ from
the schedule's, constant but for the last knot of a phase, whose u sets that of the next; the cost of a knot is weighted
with it, as an integral's would be.

The rates of the interval before give the joint accelerations: the torque limits then hold for −Jᵀf *and* the inertia of
the legs (``LegInertia``) in the pose of the guess. With (3.14) alone, which neglects it, unloaded legs whip around for free
and the last force before lift-off becomes an impulse that no leg could follow.

A take-off may begin in motion, on any of the contact points, and points may come back to the ground at another foothold
(``contacts``). In flight the legs follow a fixed path from the take-off pose through the tuck to the landing pose and turn
the body against them; because these knots are in the problem, the attitude at touchdown is the goal's, legs included.
Arms, if there are any, go where the angular momentum asks them to.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from aerial_model.robot.contact import friction_pyramid
from aerial_model.robot.robot import Robot
from aerial_planner.codegen.library import FunctionLibrary
from aerial_planner.formulation.attitude import require_attitude
from aerial_planner.formulation.contacts import Contacts, KnotContacts, knot_contacts
from aerial_planner.formulation.formulation import Formulation
from aerial_planner.formulation.kino_dynamic_layouts import KinoDynamicLayouts
from aerial_planner.formulation.knots import (
    FlightInterval,
    LiftOffKnot,
    TakeOffKnot,
    holding_joints,
    link_slopes,
    world_feet,
)
from aerial_planner.formulation.leg_inertia import inertial_torque
from aerial_planner.formulation.limits import Variant
from aerial_planner.formulation.vector_layout import StageLayout, StageSymbols
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.kinematics.quaternion import attitude_error
from aerial_planner.motion.schedule import Schedule, contact_bits
from aerial_planner.ocp.options import SolverOptions
from aerial_planner.ocp.stage import Rows, StageKind
from aerial_planner.settings import PlannerSettings


@dataclass(frozen=True, kw_only=True)
class TakeOffKind:
    """The contacts and the place of a take-off knot, by which it differs from others."""

    contacts: KnotContacts
    ends_phase: bool = False  # the next knot is of another phase, whose time steps are chosen here
    last: bool = False  # the contacts end with its interval

    @property
    def suffix(self) -> str:
        """Its place in the take-off as the end of a name."""
        return "_last" if self.last else "_end" if self.ends_phase else ""


class KinoDynamicStages(Formulation):
    """The stage kinds that the kino-dynamic problems of one robot and variant are made of.

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
        # Joints of the whole robot that carry no contact: arms, which the flight moves, and held ones, which bear it.
        upper = np.union1d(robot.planned_joints[self.robot.arms], np.flatnonzero(robot.held_joints))
        limited = variant is not Variant.KD and len(self.robot.arms) > 0
        self._limited_in_flight = upper if limited else upper[:0]
        self.layouts = KinoDynamicLayouts.of(robot, n_limited=len(self._limited_in_flight), timed=timed)

    def kinds(self, schedule: Schedule) -> list[StageKind]:
        """Return the stage kind of each knot."""
        take_off = self.take_off_kinds(schedule)
        kinds = [self._once(kind, self._take_off_stage, kind) for kind in take_off]
        held = take_off[-1].contacts.loaded
        kinds.append(self._once(("lift_off", held), self._lift_off_stage, held))
        kinds += [self._once("flight", self._flight_stage)] * (schedule.flight_knots - 1)
        return [*kinds, self._once("touchdown", self._touchdown_stage)]

    def take_off_kinds(self, schedule: Schedule) -> list[TakeOffKind]:
        """Return the kind of each of the N take-off knots."""
        contacts, last = knot_contacts(schedule), len(schedule.contact) - 1
        ends = self.timed & (np.diff(schedule.phase, append=schedule.phase[-1]) != 0)
        return [
            TakeOffKind(contacts=contacts[k], ends_phase=bool(ends[k]), last=k == last) for k in range(len(contacts))
        ]

    def take_off_layout(self, kind: TakeOffKind) -> StageLayout:
        """Return the variables and parameters of a take-off knot."""
        ending = int(self.ending_joints(kind).sum()) if kind.last else 0
        return self.layouts.take_off(n_loaded=sum(kind.contacts.loaded), n_ending=ending, ends_phase=kind.ends_phase)

    def ending_joints(self, kind: TakeOffKind) -> np.ndarray:
        """Return the joints ``(n,)`` bool that hold the last contacts."""
        return holding_joints(self.model, kind.contacts.loaded)

    def _take_off_stage(self, kind: TakeOffKind) -> StageKind:
        """Return a take-off knot."""
        contacts = kind.contacts
        ending = self.ending_joints(kind) if kind.last else None
        s = TakeOffKnot(self.take_off_layout(kind), contacts.loaded, ending)
        cost = self._take_off_cost(s)
        next_state = s.step(self.robot.mass)  # (3.5), (3.6)
        rows = Rows()
        if contacts.held is None:
            rows.equal("start", s.motion - s.x_0)
        else:
            self._position_rows(rows, s, contacts)
        rows.equal("momentum", s.momentum_gap(self.model))  # (3.8)
        pyramid = friction_pyramid(self.robot.friction_coefficient)[:4]
        for f in s.force.values():
            rows.between("friction", ca.DM(pyramid) @ f, 0.0, np.inf)  # (3.9b, c)
        if self.variant is not Variant.KD:
            self._actuator_rows(rows, s)
        name = f"take_off_{contacts.name}_{self._name}{kind.suffix}"
        return rows.stage(name, s.x, s.u, s.p, cost, next_state, **s.shorthands)

    def _take_off_cost(self, s: TakeOffKnot) -> ca.SX:
        """Return (3.4) of a take-off knot."""
        w = self.settings.weights
        cost = (
            w.com * ca.sumsqr(s.r - s.r_ref)
            + w.com_velocity * ca.sumsqr(s.rdot - s.rdot_ref)
            + w.orientation * ca.sumsqr(attitude_error(s.quaternion, s.quaternion_ref))
            + w.joint_position * ca.sumsqr(s.q_j - s.q_j_ref)
            + w.angular_velocity * ca.sumsqr(s.omega)
            + w.joint_velocity * ca.sumsqr(s.dq_j)
            + w.joint_acceleration * (ca.sumsqr(s.ddq_j) + ca.sumsqr(s.ddq_j_end))
            + w.force * ca.sumsqr(s.f)
        )
        return (
            cost * s.stretch if self.timed else cost
        )  # as an integral's share: else the longest time would be cheapest

    def _position_rows(self, rows: Rows, s: TakeOffKnot, contacts: KnotContacts) -> None:
        """Add that points on the ground are at their footholds (3.9a) and others above it (3.10), their links included."""
        robot, at_foothold = self.robot, contacts.at_foothold
        feet = world_feet(self.model, s)
        lengths, slopes = link_slopes(robot, self.model, s.q_j, s.R)
        for i, axis in robot.holding_rows(at_foothold):
            rows.equal("feet", feet[axis, i] - s.foot_ref[axis, i])
        links = robot.contact_links
        is_tip = [np.count_nonzero(links == link) == 1 for link in links]  # not one of the corners of a foot
        for i in range(robot.n_contacts):
            if at_foothold[i]:
                if is_tip[i]:
                    rows.between("crouch", slopes[i], self.settings.link_slope, np.inf)
                continue
            rows.between("ground", feet[2, i] - s.foot_ref[2, i], 0.0, np.inf)
            if is_tip[i]:
                # The link above the foot, too: its other end no lower than where it may stand on the foot.
                rise = (feet[2, i] - s.foot_ref[2, i]) / lengths[i] + slopes[i]
                rows.between("ground", rise, self.settings.link_slope, np.inf)

    @property
    def _name(self) -> str:
        return self.variant.name + ("_timed" if self.timed else "")

    def _actuator_rows(self, rows: Rows, s: TakeOffKnot) -> None:
        """Add torque and voltage limits (3.11b, c) of all joints at mid-interval, with τ of (3.14) plus the legs' inertia."""
        whole, law, q_j = self._whole, self._whole.actuators, s.mid["q_j"]
        if self.variant is Variant.AAKD_STAR:
            frozen = ca.DM(self.robot.frozen_joints.astype(float))
            q_j = frozen * s.q_j_frozen + (1 - frozen) * q_j
        J = self.model.foot_jacobians(q_j)  # (3 n_c, n) in B
        force_B = s.R_mid.T @ s.f
        torque = inertial_torque(s.H_joint, s.H_wrench, s.ddq_j, force_B, self.model.feet(q_j)[:, list(s.force)])
        planned = whole.planned_joints.tolist()
        speed = ca.SX(whole.n_joints, 1)
        speed[planned] = s.dq_j
        for column, i in enumerate(s.force):
            torque[planned] -= J[3 * i : 3 * i + 3, :].T @ force_B[:, column]  # (3.14)
        for joint, name in enumerate(whole.joint_names):
            rows.between(f"{name} torque", torque[joint] / law.torque_max[joint] / s.margin[joint], -1.0, 1.0)
            volts = law.volts_per_torque[joint] * torque[joint] + law.volts_per_speed[joint] * speed[joint]
            rows.between(f"{name} voltage", volts / law.bus_voltage[joint] / s.margin[joint], -1.0, 1.0)

    def _lift_off_stage(self, held: Contacts) -> StageKind:
        """Return the knot at which the last contacts end: the ballistic path from here ends at the goal."""
        robot, w = self.robot, self.settings.weights
        s = LiftOffKnot(self.layouts.lift_off)
        flight = FlightInterval(robot, s, s.dq_before[robot.arms.tolist()], first=True)
        cost = (
            w.angular_velocity * ca.sumsqr(s.omega)
            + w.joint_velocity * ca.sumsqr(s.dq_before)
            + w.flight_time * (s.T - s.T_ref) ** 2
            + self._arm_cost(flight)
        )
        rows = Rows()
        feet, slip = world_feet(self.model, s), s.foot_velocities(self.model)
        holding = robot.holding_rows(held)
        for i, axis in holding:
            rows.equal("feet", feet[axis, i] - s.foot_ref[axis, i])  # (3.9a)
        for i in np.flatnonzero(~np.array(held)).tolist():
            rows.between("ground", feet[2, i] - s.foot_ref[2, i], 0.0, np.inf)  # (3.10)
        rows.equal("landing position", s.landing_gap)
        rows.equal("momentum", flight.momentum_gap(self.model))  # (3.8)
        self._onset_rows(rows, s, flight)
        # Contacts end with their points at rest: else the last force could be an impulse that no leg follows.
        rows.equal("momentum", s.momentum_gap(self.model))
        for i, axis in holding:
            rows.equal("feet", slip[i][axis])
        name = f"lift_off_{contact_bits(held)}_{self._name}"
        return rows.stage(name, s.x, s.u, s.p, cost, flight.step(self.layouts.flight))

    def _onset_rows(self, rows: Rows, s: LiftOffKnot, flight: FlightInterval) -> None:
        """Add torque limits of all joints as the flight begins, when legs end the take-off's motion and set out to fold."""
        if self.variant is Variant.KD:
            return
        settling, folding = s.onset[0], s.onset[1] / s.T**2
        acceleration = folding * (s.pose_ahead - s.q_j) - settling * s.dq_before
        arms = self.robot.arms.tolist()
        if arms:
            acceleration[arms] = flight.arm_acceleration
        self._torque_rows(rows, range(self._whole.n_joints), ca.mtimes(s.H_flight, acceleration), s.margin)

    def _flight_stage(self) -> StageKind:
        """Return a knot in the air."""
        w, layout = self.settings.weights, self.layouts.flight
        s = StageSymbols(layout)
        flight = FlightInterval(self.robot, s, s.arm_rate_before)
        cost = (
            w.angular_velocity * ca.sumsqr(s.omega)
            + w.orientation * ca.sumsqr(attitude_error(s.quaternion, s.quaternion_ref))
            + self._arm_cost(flight)
        )
        rows = Rows()
        rows.equal("momentum", flight.momentum_gap(self.model))  # (3.8)
        if len(self._limited_in_flight) > 0:
            # In free fall weight asks for no torque, but inertia does: that of the arms, and that of the legs, which follow
            # their path whatever the arms do: both at the guess, but for how fast the path is in a longer or shorter flight.
            torque = s.tau_settling + s.tau_folding / s.T**2 + ca.mtimes(s.H_arms, flight.arm_acceleration)
            self._torque_rows(rows, self._limited_in_flight.tolist(), torque, s.margin)
        name = "flight" if len(self.robot.arms) == 0 else f"flight_{self.variant.name}"
        return rows.stage(name, s.x, s.u, s.p, cost, flight.step(layout))

    def _torque_rows(self, rows: Rows, joints: Iterable[int], torque: ca.SX, margin: ca.SX) -> None:
        """Add that the torques of some of the whole robot's joints keep to a share of their limits."""
        for row, joint in enumerate(joints):
            limit = float(self._whole.actuators.torque_max[joint]) * margin[row]
            rows.between(f"{self._whole.joint_names[joint]} torque", torque[row] / limit, -1.0, 1.0)

    def _arm_cost(self, flight: FlightInterval) -> ca.SX:
        """Return the cost of how arms move: without one they would jump, in flight as on the ground."""
        w, arms = self.settings.weights, self.robot.arms.tolist()
        return (
            w.joint_position * ca.sumsqr((flight.q_j - flight.pose_ahead)[arms])
            + w.joint_velocity * ca.sumsqr(flight.arm_rate)
            + w.joint_acceleration * ca.sumsqr(flight.arm_acceleration)
        )

    def _touchdown_stage(self) -> StageKind:
        """Return the last knot, whose attitude is the goal's."""
        s, rows = StageSymbols(self.layouts.touchdown), Rows()
        require_attitude(rows, s.quaternion, s.goal)
        return rows.stage("touchdown", s.x, s.u, s.p, ca.SX(0), None)
