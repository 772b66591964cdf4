"""The stage kinds of the single-rigid-body problem (3.15)–(3.19).

    take-off knot   x = [r, ṙ, α, quaternion],   u = [f of the loaded contacts]
    lift-off knot   x as above,                  u = [the flight time T]
    flight knot     x = [α, quaternion, T],      no control

All links are lumped at the home pose, so the body rate is ω = I⁻¹ Rᵀ α. Contact points are at their footholds; a leg reaches
no farther than (3.18) allows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from aerial_model.robot.contact import friction_pyramid
from aerial_model.robot.robot import GRAVITY, Robot
from aerial_planner.codegen.library import FunctionLibrary
from aerial_planner.formulation.attitude import require_attitude
from aerial_planner.formulation.contacts import Contacts, knot_contacts
from aerial_planner.formulation.formulation import Formulation
from aerial_planner.formulation.knots import mean_com
from aerial_planner.formulation.vector_layout import StageLayout, StageSymbols, VectorLayout
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.kinematics.quaternion import attitude_error, quaternion_product, quaternion_step, rotation_matrix
from aerial_planner.motion.schedule import Schedule, contact_bits
from aerial_planner.ocp.options import SolverOptions
from aerial_planner.ocp.stage import Rows, StageKind
from aerial_planner.settings import PlannerSettings

_REACH_SAMPLES = 2000  # random poses from which the longest leg is read
_NO_CONTROL = VectorLayout("control in flight")


@dataclass(frozen=True, kw_only=True)
class BodyLayouts:
    """The layouts of the single rigid body's stage kinds; symbols as in docs/notation.md, SI units, positions in S."""

    n_c: int  # contact points

    @cached_property
    def take_off_state(self) -> VectorLayout:
        """State of take-off knots and the lift-off knot."""
        return VectorLayout("state of a body's take-off knot", r=(3,), rdot=(3,), alpha=(3,), quaternion=(4,))

    def take_off(self, n_loaded: int) -> StageLayout:
        """Return the layout of a take-off knot of which ``n_loaded`` contact points bear load."""
        return StageLayout(
            state=self.take_off_state,
            control=VectorLayout("control of a body's take-off knot", f=(3, n_loaded)),
            parameters=VectorLayout(
                "parameters of a body's take-off knot",
                dt=(),
                r_ref=(3,),
                rdot_ref=(3,),
                quaternion_ref=(4,),
                foot_ref=(3, self.n_c),
                x_0=(self.take_off_state.size,),
            ),
        )

    @cached_property
    def lift_off(self) -> StageLayout:
        """The knot at which the last contacts end and the flight begins."""
        return StageLayout(
            state=self.take_off_state,
            control=VectorLayout("control of a body's lift-off knot", T=()),
            parameters=VectorLayout(
                "parameters of a body's lift-off knot",
                share=(),  # of the flight time, to the next knot
                T_ref=(),
                landing_com=(3,),
                foot_ref=(3, self.n_c),
            ),
        )

    @cached_property
    def flight(self) -> StageLayout:
        """The knots in the air."""
        parameters = VectorLayout("parameters of a body's flight knot", share=(), quaternion_ref=(4,))
        return StageLayout(state=self._flight_state, control=_NO_CONTROL, parameters=parameters)

    @cached_property
    def touchdown(self) -> StageLayout:
        """The last knot."""
        parameters = VectorLayout("parameters of a body's touchdown", goal=(4,))
        return StageLayout(state=self._flight_state, control=_NO_CONTROL, parameters=parameters)

    @cached_property
    def _flight_state(self) -> VectorLayout:
        return VectorLayout("state of a body's flight knot", alpha=(3,), quaternion=(4,), T=())


class _Body(StageSymbols):
    """A knot on the ground of the single rigid body."""

    def __init__(self, layout: StageLayout) -> None:
        super().__init__(layout)
        self.R = rotation_matrix(self.quaternion)  # (3, 3)

    def omega(self, inertia_inverse: np.ndarray) -> ca.SX:
        """Return ω = I⁻¹ Rᵀ α ``(3,)`` in B [rad/s]."""
        return ca.DM(inertia_inverse) @ (self.R.T @ self.alpha)


class SingleRigidBodyStages(Formulation):
    """The stage kinds that the single-rigid-body problems of one robot are made of.

    Args:
        robot: the robot, as plans see it.
        model: its expressions.
        settings: of the planner.
        options: of the solver.
        library: compiled functions; None: interpreted ones.
    """

    def __init__(
        self,
        robot: Robot,
        model: BaseFrameModel,
        settings: PlannerSettings,
        options: SolverOptions,
        library: FunctionLibrary | None = None,
    ) -> None:
        super().__init__(robot, model, settings, options, library)
        self.inertia = np.asarray(model.inertia(robot.poses["home"]))  # (3, 3) about the centre of mass, in B [kg·m²]
        self.inertia_inverse = np.linalg.inv(self.inertia)
        self.attachment, self.leg_length = _legs(robot, model)  # (n_c, 3) from the centre of mass in B; (n_c,) [m]
        self.layouts = BodyLayouts(n_c=robot.n_contacts)

    def kinds(self, schedule: Schedule) -> list[StageKind]:
        """Return the stage kind of each knot."""
        take_off = [(contacts.loaded, contacts.held is None) for contacts in knot_contacts(schedule)]
        kinds = [self._once(("take_off", *key), self._take_off_stage, *key) for key in take_off]
        held = take_off[-1][0]
        kinds.append(self._once(("lift_off", held), self._lift_off_stage, held))
        kinds += [self._once("flight", self._flight_stage)] * (schedule.flight_knots - 1)
        return [*kinds, self._once("touchdown", self._touchdown_stage)]

    def _take_off_stage(self, loaded: Contacts, first: bool) -> StageKind:
        """Return a take-off knot."""
        s, w = _Body(self.layouts.take_off(sum(loaded))), self.settings.weights
        force = {i: s.f[:, column] for column, i in enumerate(np.flatnonzero(loaded).tolist())}
        cost = (
            w.com * ca.sumsqr(s.r - s.r_ref)
            + w.com_velocity * ca.sumsqr(s.rdot - s.rdot_ref)
            + w.orientation * ca.sumsqr(attitude_error(s.quaternion, s.quaternion_ref))
            + w.angular_velocity * ca.sumsqr(s.omega(self.inertia_inverse))
            + w.force * ca.sumsqr(s.f)
        )
        rddot, alpha_dot = ca.SX(-ca.vertcat(0, 0, GRAVITY)), ca.SX.zeros(3)
        for i, f in force.items():
            rddot = rddot + f / self.robot.mass
            alpha_dot = alpha_dot + ca.cross(s.foot_ref[:, i] - mean_com(s.r, s.rdot, s.dt), f)
        rdot_next = s.rdot + rddot * s.dt
        next_state = self.layouts.take_off_state.join(
            r=s.r + 0.5 * (s.rdot + rdot_next) * s.dt,
            rdot=rdot_next,
            alpha=s.alpha + alpha_dot * s.dt,
            quaternion=quaternion_product(s.quaternion, quaternion_step(s.omega(self.inertia_inverse), s.dt)),
        )
        rows = Rows()
        if first:
            rows.equal("start", s.x - s.x_0)
        else:
            self._reach_rows(rows, s, loaded)
        pyramid = friction_pyramid(self.robot.friction_coefficient)[:4]
        for f in force.values():
            rows.between("friction", ca.DM(pyramid) @ f, 0.0, np.inf)
        return rows.stage(f"body_{'start_' if first else ''}{contact_bits(loaded)}", s.x, s.u, s.p, cost, next_state)

    def _reach_rows(self, rows: Rows, s: _Body, held: Sequence[bool]) -> None:
        """Add (3.18): the distance from a held contact to its leg's attachment is at most β ℓ."""
        for i in np.flatnonzero(held).tolist():
            leg = s.foot_ref[:, i] - (s.r + s.R @ ca.DM(self.attachment[i]))
            length = self.settings.reach * self.leg_length[i]
            rows.between("leg length", ca.sumsqr(leg) / length**2, -np.inf, 1.0)

    def _lift_off_stage(self, held: Contacts) -> StageKind:
        """Return the knot at which the last contacts end: the ballistic path from here ends at the goal."""
        s = _Body(self.layouts.lift_off)
        cost = self.settings.weights.flight_time * (s.T - s.T_ref) ** 2
        rows = Rows()
        self._reach_rows(rows, s, held)
        landing = s.r + s.T * s.rdot - ca.vertcat(0, 0, 0.5 * GRAVITY * s.T**2)
        rows.equal("landing position", landing - s.landing_com)
        return rows.stage(f"body_lift_off_{contact_bits(held)}", s.x, s.u, s.p, cost, self._flight_step(s))

    def _flight_stage(self) -> StageKind:
        """Return a knot in the air."""
        s = StageSymbols(self.layouts.flight)
        cost = self.settings.weights.orientation * ca.sumsqr(attitude_error(s.quaternion, s.quaternion_ref))
        return Rows().stage("body_flight", s.x, s.u, s.p, cost, self._flight_step(s))

    def _touchdown_stage(self) -> StageKind:
        """Return the last knot, whose attitude is the goal's."""
        s, rows = StageSymbols(self.layouts.touchdown), Rows()
        require_attitude(rows, s.quaternion, s.goal)
        return rows.stage("body_touchdown", s.x, s.u, s.p, ca.SX(0), None)

    def _flight_step(self, s: StageSymbols) -> ca.SX:
        """Return α, the attitude and T after a share of the flight, by the mid-point rule."""
        dt, I_inverse = s.share * s.T, ca.DM(self.inertia_inverse)
        omega = I_inverse @ (rotation_matrix(s.quaternion).T @ s.alpha)
        middle = quaternion_product(s.quaternion, quaternion_step(omega, 0.5 * dt))
        omega_mid = I_inverse @ (rotation_matrix(middle).T @ s.alpha)
        return self.layouts.flight.state.join(
            alpha=s.alpha, quaternion=quaternion_product(s.quaternion, quaternion_step(omega_mid, dt)), T=s.T
        )


def _legs(robot: Robot, model: BaseFrameModel) -> tuple[np.ndarray, np.ndarray]:
    """Return where each contact's leg is attached, from the centre of mass in B, and how far the contact reaches."""
    home = robot.poses["home"]
    com = np.asarray(model.com(home)).ravel()
    attachment = np.zeros((robot.n_contacts, 3))
    for i, frame_id in enumerate(robot.contact_frames):
        joint = robot.model.frames[frame_id].parentJoint
        while robot.model.parents[joint] > 1:
            joint = robot.model.parents[joint]
        attachment[i] = robot.model.jointPlacements[joint].translation
    poses = np.random.default_rng(0).uniform(*robot.planning_range, size=(_REACH_SAMPLES, robot.n_joints))
    return attachment - com, np.max(np.linalg.norm(model.feet_at(poses) - attachment, axis=2), axis=0)
