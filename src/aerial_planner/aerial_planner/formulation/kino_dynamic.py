"""The kino-dynamic stage: the numbers of one request for the knots of ``kino_dynamic_kinds``, and what comes of them."""

from __future__ import annotations

import numpy as np

from aerial_model.robot.robot import Robot
from aerial_planner.formulation.kino_dynamic_kinds import KinoDynamicKinds
from aerial_planner.formulation.knots import LegInertia, holding_joints
from aerial_planner.formulation.limits import Margin, Variant
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.motion.schedule import Schedule
from aerial_planner.ocp.problem import Solution
from aerial_planner.ocp.stage import StageData
from aerial_planner.reference.body import Reference
from aerial_planner.reference.flight_path import FlightPath


class KinoDynamic(KinoDynamicKinds):
    """Builds and solves the kino-dynamic problems of one robot and variant."""

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
        """Return by how much ``trajectory`` misses any constraint, SI units, torque limits of the take-off as at ``guess``."""
        inertia = leg_inertia_along(self._whole, guess)
        stages = self._stages(schedule, reference, trajectory, self._usual_margin, inertia)
        return self.problem(schedule).violation(stages)

    def _stages(
        self,
        schedule: Schedule,
        reference: Reference,
        guess: TakeOffTrajectory,
        margin: Margin,
        inertia: LegInertia,
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
        inertia: LegInertia,
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
        before = np.vstack([reference.start_joint_velocity, guess.joint_velocity[: N - 1], guess.joint_velocity[-1]])
        x = np.hstack(
            [guess.com, guess.com_velocity, guess.angular_momentum, guess.orientation, guess.joint_position, before]
        )
        stretch, least, greatest = self._stretches(schedule, guess)  # (N+1, 0 or 1) each
        x, x_min, x_max = np.hstack([x, stretch]), np.hstack([x_min, least]), np.hstack([x_max, greatest])
        ends = np.append(np.diff(schedule.phase) != 0, False)
        ground = reference.foot_position.copy()  # and above which height feet in the air must be
        ground[..., 2] += reference.foot_clearance
        given = [reference.com, reference.com_velocity, reference.orientation, reference.joint_position]
        p = np.hstack(
            [
                np.full((N, 1), schedule.dt),
                *(rows[:N] for rows in given),
                np.tile(reference.x_0[-n:], (N, 1)),
                ground[:N].reshape(N, -1),
                np.tile(np.concatenate([reference.x_0, reference.start_joint_velocity, margin.take_off]), (N, 1)),
                inertia.parameters,
            ]
        )
        least_force = np.tile([-np.inf, -np.inf, settings.force_min], self.robot.n_contacts)
        greatest_force = np.tile([np.inf, np.inf, settings.force_max], self.robot.n_contacts)
        unbounded = np.full(3, np.inf)
        stages = []
        for k in range(N):
            loaded = schedule.contact[k]
            n_f = 3 * int(loaded.sum())
            u = [guess.angular_velocity[k], guess.joint_velocity[k], guess.force[k][loaded].ravel()]
            u_min, u_max = [-unbounded, -speed, least_force[:n_f]], [unbounded, speed, greatest_force[:n_f]]
            if k == N - 1:
                free = np.full(holding.sum(), np.inf)
                u, u_min, u_max = [*u, guess.joint_velocity[-1][holding]], [*u_min, -free], [*u_max, free]
            elif ends[k]:
                u, u_min, u_max = [*u, stretch[k + 1]], [*u_min, least[k + 1]], [*u_max, greatest[k + 1]]
            stages.append(
                StageData(
                    p=p[k],
                    x=x[k],
                    x_min=x_min[k],
                    x_max=x_max[k],
                    u=np.concatenate(u),
                    u_min=np.concatenate(u_min),
                    u_max=np.concatenate(u_max),
                )
            )
        path = reference.flight_path
        last = LegInertia.along(self._whole, guess.joint_position[-1:])[0]
        p = [
            *([schedule.dt], ground[N].ravel(), [schedule.flight_time], reference.landing_com, path.parameters(0)),
            *(margin.flight, last.parameters[: last.joint.size]),
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
        """Return the parameters of ``_upper_rows`` at each flight knot after the lift-off's, one row each."""
        M, joints, arms = len(path.fraction), self._upper, self.robot.arms
        if self.variant is Variant.KD or len(arms) == 0:
            return np.zeros((M - 1, 0))
        legs = np.setdiff1d(np.arange(self.robot.n_joints), arms)
        dt = guess.flight_time / M
        middle = (np.arange(M) + 0.5) * dt
        start, T = guess.joint_position[-1], guess.flight_time
        _, rate = path.at(start, middle, T)
        _, both = path.from_take_off(start, guess.joint_velocity[-1], middle, T)
        limits = []
        along = LegInertia.along(self._whole, guess.flight_joint_position)
        for k in range(1, M):
            inertia = along.joint[k, joints]
            folding, total = (rate[k] - rate[k - 1]) / dt, (both[k] - both[k - 1]) / dt
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
                p = np.concatenate([path.parameters(k), reference.flight_orientation[k], limits[k - 1]])
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


def leg_inertia_along(robot: Robot, guess: TakeOffTrajectory) -> LegInertia:
    """Return what the torque limits count of the legs' inertia on each take-off interval: its value at the guess."""
    middle = 0.5 * (guess.joint_position[:-1] + guess.joint_position[1:])
    return LegInertia.along(robot, middle)
