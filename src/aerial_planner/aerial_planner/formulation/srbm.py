"""The single-rigid-body problem: the numbers of one request for the stages of ``srbm_stages``, and their optimum.

It is small, and its optimum starts the kino-dynamic problem: joint trajectories come from inverse kinematics.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from aerial_model.numerics import rotation
from aerial_model.robot.robot import GRAVITY, Robot
from aerial_planner.codegen.library import FunctionLibrary
from aerial_planner.formulation.srbm_stages import SingleRigidBodyStages
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.kinematics.inverse_kinematics import InverseKinematics
from aerial_planner.motion.schedule import Schedule
from aerial_planner.ocp.options import SolverOptions
from aerial_planner.ocp.problem import Solution
from aerial_planner.ocp.stage import StageData
from aerial_planner.reference.body import Reference
from aerial_planner.settings import PlannerSettings

_ITERATIONS_MAX = 35  # of one try: those that succeed take 8 to 30
# Of its optimum, which is but a start: the kino-dynamic problem takes as many iterations, this one two or three less.
_TOLERANCE = 0.1


class SingleRigidBody(SingleRigidBodyStages):
    """Builds and solves the single-rigid-body problems of one robot.

    Args:
        robot: the robot, as plans see it.
        model: its expressions.
        ik: inverse kinematics, for the joint trajectories.
        settings: of the planner.
        options: of the solver, but for its own tolerance and limit of iterations.
        library: compiled functions; None: interpreted ones.
    """

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

    def _stages(self, schedule: Schedule, reference: Reference) -> list[StageData]:
        """Return parameters, bounds and guess of each knot."""
        return [
            *self._take_off_data(schedule, reference),
            self._lift_off_data(schedule, reference),
            *self._flight_data(schedule, reference),
        ]

    def _take_off_data(self, schedule: Schedule, reference: Reference) -> list[StageData]:
        """Return the numbers of the take-off knots."""
        x, push = self._state_guess(reference), self._pushes(schedule)
        stages = []
        for k, loaded in enumerate(schedule.contact):
            layout = self.layouts.take_off(int(loaded.sum()))
            p = layout.parameters.pack(
                dt=schedule.dt,
                r_ref=reference.com[k],
                rdot_ref=reference.com_velocity[k],
                quaternion_ref=reference.orientation[k],
                foot_ref=reference.foot_position[k].T,
                x_0=reference.x_0[: self.layouts.take_off_state.size],
            )
            least, greatest = ([-np.inf, -np.inf, self.settings.force_min], [np.inf, np.inf, self.settings.force_max])
            u_min, u_max = (np.tile(bound, int(loaded.sum())) for bound in (least, greatest))
            u = layout.control.pack(f=push[k][loaded].T)
            stages.append(StageData.free(p=p, x=x[k], u=u, u_min=u_min, u_max=u_max))
        return stages

    def _lift_off_data(self, schedule: Schedule, reference: Reference) -> StageData:
        """Return the numbers of the lift-off knot."""
        layout = self.layouts.lift_off
        p = layout.parameters.pack(
            share=1 / schedule.flight_knots,
            T_ref=schedule.flight_time,
            landing_com=reference.landing_com,
            foot_ref=reference.foot_position[-1].T,
        )
        u, u_min, u_max = (layout.control.pack(T=T) for T in (schedule.flight_time, *schedule.flight_time_range))
        return StageData.free(p=p, x=self._state_guess(reference)[-1], u=u, u_min=u_min, u_max=u_max)

    def _flight_data(self, schedule: Schedule, reference: Reference) -> list[StageData]:
        """Return the numbers of the knots from the first in the air to touchdown."""
        turned = reference.flight_orientation[1:]
        x = self.layouts.flight.state.pack(
            alpha=reference.angular_momentum[-1], quaternion=turned, T=schedule.flight_time
        )
        p = self.layouts.flight.parameters.pack(share=1 / schedule.flight_knots, quaternion_ref=turned[:-1])
        goal = self.layouts.touchdown.parameters.pack(goal=schedule.landing_orientation)
        return [StageData.free(p=p_k, x=x_k) for p_k, x_k in zip([*p, goal], x, strict=True)]

    def _state_guess(self, reference: Reference) -> np.ndarray:
        """Return the reference as states of the N + 1 knots on the ground."""
        return self.layouts.take_off_state.pack(
            r=reference.com,
            rdot=reference.com_velocity,
            alpha=reference.angular_momentum,
            quaternion=reference.orientation,
        )

    def _pushes(self, schedule: Schedule) -> np.ndarray:
        """Return forces ``(N, n_c, 3)`` [N] that bear the weight, evenly by all contacts that push.

        Those that lift the body as in the reference are a guess that saves jumps an iteration, and loses flips to the side.
        """
        force = np.zeros((*schedule.contact.shape, 3))
        force[..., 2] = self.robot.mass * GRAVITY * schedule.contact
        return np.asarray(force / np.maximum(1, schedule.contact.sum(axis=1))[:, None, None])

    def _trajectory(self, schedule: Schedule, reference: Reference, solution: Solution) -> TakeOffTrajectory:
        """Return the trajectory of a solution; points in the air are where the reference has them."""
        N, layouts = len(schedule.contact), self.layouts
        x = layouts.take_off_state.unpack(np.array(solution.x[: N + 1]))
        R = rotation.matrix(x["quaternion"])  # (N+1, 3, 3)
        feet = np.einsum("kba,kib->kia", R, reference.foot_position - x["r"][:, None])  # from the CoM, in B
        q_j = self.ik.solve(feet, reference.joint_position)
        rates = np.diff(q_j, axis=0) / schedule.dt
        force = np.zeros((N, self.robot.n_contacts, 3))
        for k, loaded in enumerate(schedule.contact):
            force[k][loaded] = layouts.take_off(int(loaded.sum())).control.unpack(solution.u[k])["f"].T
        flight = layouts.flight.state.unpack(np.array(solution.x[N + 1 :]))
        turned = np.vstack([x["quaternion"][N], flight["quaternion"]])
        alpha = np.vstack([x["alpha"][N], flight["alpha"]])
        return TakeOffTrajectory(
            dt=np.full(N, schedule.dt),
            com=x["r"],
            com_velocity=x["rdot"],
            angular_momentum=x["alpha"],
            orientation=x["quaternion"],
            joint_position=q_j,
            angular_velocity=self._angular_velocities(x["alpha"], R),
            joint_velocity=np.vstack([rates, rates[-1:]]),
            force=force,
            flight_time=float(layouts.lift_off.control.unpack(solution.u[N])["T"]),
            flight_orientation=turned,
            flight_joint_position=reference.flight_path.at_knots(q_j[-1]),
            flight_angular_velocity=self._angular_velocities(alpha, rotation.matrix(turned))[:-1],
        )

    def _angular_velocities(self, alpha: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Return ω = I⁻¹ Rᵀ α ``(K, 3)`` in B [rad/s]."""
        return np.asarray(np.einsum("ab,kcb,kc->ka", self.inertia_inverse, R.transpose(0, 2, 1), alpha))
