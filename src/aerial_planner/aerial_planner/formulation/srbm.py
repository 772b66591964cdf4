"""The single-rigid-body stage (3.15)–(3.19): a small problem whose optimum starts the kino-dynamic one.

    take-off knot   x = [r, ṙ, α, quaternion],   u = [f of the loaded contacts]
    flight knot     x = [α, quaternion],         no control

All links are lumped at the home pose, so the body rate is ω = I⁻¹ Rᵀ α. Contacts stand where the robot stands; a leg
reaches no farther than (3.18) allows. Joint trajectories then come from inverse kinematics.
"""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np

from aerial_model.numerics import rotation
from aerial_model.robot.contact import friction_pyramid
from aerial_model.robot.robot import GRAVITY, Robot
from aerial_planner.codegen.library import FunctionLibrary
from aerial_planner.formulation.attitude import require_attitude
from aerial_planner.formulation.formulation import Formulation
from aerial_planner.formulation.knots import mean_com
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.kinematics.base_frame import (
    BaseFrameModel,
    attitude_error,
    quaternion_product,
    quaternion_step,
    rotation_matrix,
)
from aerial_planner.kinematics.inverse_kinematics import InverseKinematics
from aerial_planner.motion.schedule import Schedule, contact_bits
from aerial_planner.ocp.options import SolverOptions
from aerial_planner.ocp.problem import Solution
from aerial_planner.ocp.stage import Rows, StageData, StageKind
from aerial_planner.reference.body import Reference
from aerial_planner.settings import PlannerSettings

_ITERATIONS_MAX = 35  # of one try: those that succeed take 8 to 30
_TOLERANCE = (
    0.1  # of its optimum, which is but a start: what follows takes as many iterations, this one two or three less
)
_REACH_SAMPLES = 2000  # random poses from which the longest leg is read


class SingleRigidBody(Formulation):
    """Builds and solves the single-rigid-body problems of one robot."""

    def __init__(
        self,
        robot: Robot,
        model: BaseFrameModel,
        ik: InverseKinematics,
        settings: PlannerSettings,
        options: SolverOptions,
        library: FunctionLibrary | None = None,
    ) -> None:
        iterations = min(options.max_iterations, _ITERATIONS_MAX)
        options = dataclasses.replace(options, max_iterations=iterations, tolerance=max(options.tolerance, _TOLERANCE))
        super().__init__(robot, model, settings, options, library)
        self.ik = ik
        home = robot.poses["home"]
        self.inertia = np.asarray(model.inertia(home))  # (3, 3) about the centre of mass, in B [kg·m²]
        self.inertia_inverse = np.linalg.inv(self.inertia)
        self.attachment, self.leg_length = _legs(robot, model)  # (n_c, 3) from the centre of mass in B; (n_c,) [m]

    def solve(self, schedule: Schedule, reference: Reference) -> tuple[TakeOffTrajectory, Solution]:
        """Return the optimum near the reference, with joint trajectories, and the solver's account of it.

        The reference is within the few limits of a single rigid body, so the first try starts at a small barrier.
        """
        stages = self._stages(schedule, reference)
        solution = self.problem(schedule, near=True).solve(stages)
        if not solution.converged:
            second = self.problem(schedule).solve(stages)
            solution = dataclasses.replace(second, iterations=solution.iterations + second.iterations)
        return self._trajectory(schedule, reference, solution), solution

    def reference_trajectory(self, schedule: Schedule, reference: Reference) -> TakeOffTrajectory:
        """Return the bare reference as a guess: what a kino-dynamic stage without warm start begins from."""
        N, M = len(schedule.contact), schedule.flight_knots
        pose = reference.joint_position[-1]
        return TakeOffTrajectory(
            dt=np.full(N, schedule.dt),
            com=reference.com,
            com_velocity=reference.com_velocity,
            angular_momentum=reference.angular_momentum,
            orientation=reference.orientation,
            joint_position=reference.joint_position,
            angular_velocity=np.zeros((N + 1, 3)),
            joint_velocity=np.zeros((N + 1, self.robot.n_joints)),
            force=self._pushes(schedule),
            flight_time=schedule.flight_time,
            flight_orientation=reference.flight_orientation,
            flight_joint_position=reference.flight_path.at_knots(pose),
            flight_angular_velocity=np.zeros((M, 3)),
        )

    def kinds(self, schedule: Schedule) -> list[StageKind]:
        """Return the stage kind of each knot."""
        rows = [tuple(bool(b) for b in row) for row in schedule.contact]
        kinds = [self._take_off_kind(row, first=k == 0) for k, row in enumerate(rows)]
        kinds.append(self._lift_off_kind(rows[-1]))
        kinds += [self._flight_kind()] * (schedule.flight_knots - 1)
        return [*kinds, self._touchdown_kind()]

    def _take_off_kind(self, loaded: tuple[bool, ...], *, first: bool) -> StageKind:
        key = ("take_off", loaded, first)
        if key in self._kinds:
            return self._kinds[key]
        robot, w = self.robot, self.settings.weights
        s = _BodySymbols(robot.n_contacts)
        force = {int(i): ca.SX.sym(f"f_{i}", 3) for i in np.flatnonzero(loaded)}
        u = ca.vertcat(*force.values())
        dt, r_ref, rdot_ref, quaternion_ref = ca.SX.sym("dt"), *(ca.SX.sym(n, 3) for n in ("r", "v")), ca.SX.sym("q", 4)
        x_0 = ca.SX.sym("x_0", 13)

        cost = (
            w.com * ca.sumsqr(s.r - r_ref)
            + w.com_velocity * ca.sumsqr(s.rdot - rdot_ref)
            + w.orientation * ca.sumsqr(attitude_error(s.quaternion, quaternion_ref))
            + w.angular_velocity * ca.sumsqr(s.omega(self.inertia_inverse))
            + w.force * ca.sumsqr(u)
        )

        rddot, alpha_dot = -ca.vertcat(0, 0, GRAVITY), ca.SX.zeros(3)
        for i, f in force.items():
            rddot += f / robot.mass
            alpha_dot += ca.cross(s.foot_ref[:, i] - mean_com(s.r, s.rdot, dt), f)
        rdot_next = s.rdot + rddot * dt
        following = ca.vertcat(
            s.r + 0.5 * (s.rdot + rdot_next) * dt,
            rdot_next,
            s.alpha + alpha_dot * dt,
            quaternion_product(s.quaternion, quaternion_step(s.omega(self.inertia_inverse), dt)),
        )

        rows = Rows()
        if first:
            rows.equal("start", s.x - x_0)
        else:
            self._reach_rows(rows, s, loaded)
        pyramid = friction_pyramid(robot.friction_coefficient)[:4]
        for f in force.values():
            rows.between("friction", ca.DM(pyramid) @ f, 0.0, np.inf)
        p = ca.vertcat(dt, r_ref, rdot_ref, quaternion_ref, ca.vec(s.foot_ref), x_0)
        self._kinds[key] = rows.stage(
            f"body_{'start_' if first else ''}{contact_bits(loaded)}", s.x, u, p, cost, following
        )
        return self._kinds[key]

    def _reach_rows(self, rows: Rows, s: _BodySymbols, held: tuple[bool, ...]) -> None:
        """Add (3.18): the distance from a held contact to its leg's attachment is at most β ℓ."""
        for i in np.flatnonzero(held):
            leg = s.foot_ref[:, i] - (s.r + s.R @ ca.DM(self.attachment[i]))
            length = self.settings.reach * self.leg_length[i]
            rows.between("leg length", ca.sumsqr(leg) / length**2, -np.inf, 1.0)

    def _lift_off_kind(self, held: tuple[bool, ...]) -> StageKind:
        key = ("lift_off", held)
        if key not in self._kinds:
            s = _BodySymbols(self.robot.n_contacts)
            share, T, T_ref = (ca.SX.sym(name) for name in ("share", "T", "T_ref"))
            landing_com = ca.SX.sym("goal", 3)
            rows = Rows()
            self._reach_rows(rows, s, held)
            rows.equal("landing position", s.landing_gap(T, landing_com))
            p = ca.vertcat(share, T_ref, landing_com, ca.vec(s.foot_ref))
            following = _flight_step(s.alpha, s.quaternion, T, share, self.inertia_inverse)
            cost = self.settings.weights.flight_time * (T - T_ref) ** 2
            self._kinds[key] = rows.stage(f"body_lift_off_{contact_bits(held)}", s.x, T, p, cost, following)
        return self._kinds[key]

    def _flight_kind(self) -> StageKind:
        key = ("flight",)
        if key not in self._kinds:
            alpha, quaternion = ca.SX.sym("alpha", 3), ca.SX.sym("quat", 4)
            T, share, quaternion_ref = ca.SX.sym("T"), ca.SX.sym("share"), ca.SX.sym("quat_ref", 4)
            x = ca.vertcat(alpha, quaternion, T)
            following = _flight_step(alpha, quaternion, T, share, self.inertia_inverse)
            turn = attitude_error(quaternion, quaternion_ref)
            cost = self.settings.weights.orientation * ca.sumsqr(turn)
            p = ca.vertcat(share, quaternion_ref)
            self._kinds[key] = Rows().stage("body_flight", x, ca.SX(0, 1), p, cost, following)
        return self._kinds[key]

    def _touchdown_kind(self) -> StageKind:
        key = ("touchdown",)
        if key not in self._kinds:
            x, goal = ca.SX.sym("x", 8), ca.SX.sym("goal", 4)
            rows = Rows()
            require_attitude(rows, x[3:7], goal)
            self._kinds[key] = rows.stage("body_touchdown", x, ca.SX(0, 1), goal, ca.SX(0), None)
        return self._kinds[key]

    def _stages(self, schedule: Schedule, reference: Reference) -> list[StageData]:
        settings = self.settings
        foot_ref = reference.foot_position.reshape(len(schedule.contact) + 1, -1)
        push = self._pushes(schedule)
        x = np.hstack([reference.com, reference.com_velocity, reference.angular_momentum, reference.orientation])
        stages = []
        least = np.tile([-np.inf, -np.inf, settings.force_min], self.robot.n_contacts)
        greatest = np.tile([np.inf, np.inf, settings.force_max], self.robot.n_contacts)
        for k, loaded in enumerate(schedule.contact):
            n_f = 3 * int(loaded.sum())
            p = [[schedule.dt], reference.com[k], reference.com_velocity[k], reference.orientation[k]]
            p += [foot_ref[k], reference.x_0[:13]]
            u = push[k][loaded].ravel()
            stages.append(StageData.free(p=np.concatenate(p), x=x[k], u=u, u_min=least[:n_f], u_max=greatest[:n_f]))
        share, T = np.array([1 / schedule.flight_knots]), np.array([schedule.flight_time])
        shortest, longest = (np.array([bound]) for bound in schedule.flight_time_range)
        p = [share, T, reference.landing_com, foot_ref[-1]]
        stages.append(StageData.free(p=np.concatenate(p), x=x[-1], u=T, u_min=shortest, u_max=longest))
        for k in range(1, schedule.flight_knots + 1):
            turned = reference.flight_orientation[k]
            p = schedule.landing_orientation if k == schedule.flight_knots else np.append(share, turned)
            stages.append(StageData.free(p=p, x=np.concatenate([reference.angular_momentum[-1], turned, T])))
        return stages

    def _pushes(self, schedule: Schedule) -> np.ndarray:
        """Return forces ``(N, n_c, 3)`` [N] that bear the weight, evenly by all contacts that push.

        Those that lift the body as in the reference are a guess that saves jumps an iteration, and loses flips to the side.
        """
        force = np.zeros((*schedule.contact.shape, 3))
        force[..., 2] = self.robot.mass * GRAVITY * schedule.contact
        return force / np.maximum(1, schedule.contact.sum(axis=1))[:, None, None]

    def _trajectory(self, schedule: Schedule, reference: Reference, solution: Solution) -> TakeOffTrajectory:
        N = len(schedule.contact)
        x = np.array(solution.x[: N + 1])
        com, alpha, quaternion = x[:, :3], x[:, 6:9], x[:, 9:13]
        R = rotation.matrix(quaternion)  # (N+1, 3, 3)
        feet = np.einsum("kba,kib->kia", R, reference.foot_position - com[:, None])  # from the CoM, in B
        q_j = self.ik.solve(feet, reference.joint_position)
        force = np.zeros((N, self.robot.n_contacts, 3))
        for k in range(N):
            force[k][schedule.contact[k]] = solution.u[k].reshape(-1, 3)
        flight = np.array([x[N][6:], *(x_k[:-1] for x_k in solution.x[N + 1 :])])
        flight_time = float(solution.u[N][0])
        omega = np.einsum("ab,kcb,kc->ka", self.inertia_inverse, R.transpose(0, 2, 1), alpha)
        flight_R = rotation.matrix(flight[:, 3:])
        flight_omega = np.einsum("ab,kcb,kc->ka", self.inertia_inverse, flight_R.transpose(0, 2, 1), flight[:, :3])
        rates = np.diff(q_j, axis=0) / schedule.dt
        return TakeOffTrajectory(
            dt=np.full(N, schedule.dt),
            com=com,
            com_velocity=x[:, 3:6],
            angular_momentum=alpha,
            orientation=quaternion,
            joint_position=q_j,
            angular_velocity=omega,
            joint_velocity=np.vstack([rates, rates[-1:]]),
            force=force,
            flight_time=flight_time,
            flight_orientation=flight[:, 3:],
            flight_joint_position=reference.flight_path.at_knots(q_j[-1]),
            flight_angular_velocity=flight_omega[:-1],
        )


class _BodySymbols:
    """Symbols of a take-off knot of the single rigid body."""

    def __init__(self, n_c: int) -> None:
        self.r, self.rdot, self.alpha = (ca.SX.sym(name, 3) for name in ("r", "rdot", "alpha"))
        self.quaternion = ca.SX.sym("quat", 4)
        self.x = ca.vertcat(self.r, self.rdot, self.alpha, self.quaternion)
        self.foot_ref = ca.SX.sym("foot_ref", 3, n_c)
        self.R = rotation_matrix(self.quaternion)

    def omega(self, inertia_inverse: np.ndarray) -> ca.SX:
        """Return the body rate ``(3,)`` in B [rad/s]."""
        return ca.DM(inertia_inverse) @ (self.R.T @ self.alpha)

    def landing_gap(self, T: ca.SX, landing_com: ca.SX) -> ca.SX:
        """Return where the ballistic path ends, relative to the goal ``(3,)`` [m]."""
        return self.r + T * self.rdot - ca.vertcat(0, 0, 0.5 * GRAVITY * T**2) - landing_com


def _flight_step(alpha: ca.SX, quaternion: ca.SX, T: ca.SX, share: ca.SX, inertia_inverse: np.ndarray) -> ca.SX:
    """Return α, the attitude and T after a ``share`` of the flight of the lumped body, by the mid-point rule."""
    dt = share * T
    J = ca.DM(inertia_inverse)
    omega = J @ (rotation_matrix(quaternion).T @ alpha)
    middle = quaternion_product(quaternion, quaternion_step(omega, 0.5 * dt))
    omega_mid = J @ (rotation_matrix(middle).T @ alpha)
    return ca.vertcat(alpha, quaternion_product(quaternion, quaternion_step(omega_mid, dt)), T)


def _legs(robot: Robot, model: BaseFrameModel) -> tuple[np.ndarray, np.ndarray]:
    """Return where each contact's leg is attached, from the centre of mass in B, and how far the contact reaches."""
    home = robot.poses["home"]
    com = np.asarray(model.com(home)).ravel()
    attachment = []
    for frame_id in robot.contact_frames:
        joint = robot.model.frames[frame_id].parentJoint
        while robot.model.parents[joint] > 1:
            joint = robot.model.parents[joint]
        attachment.append(robot.model.jointPlacements[joint].translation)
    attachment = np.array(attachment)
    poses = np.random.default_rng(0).uniform(*robot.planning_range, size=(_REACH_SAMPLES, robot.n_joints))
    return attachment - com, np.max(np.linalg.norm(model.feet_at(poses) - attachment, axis=2), axis=0)
