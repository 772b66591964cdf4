"""The kino-dynamic problem: the numbers of one request for the stages of ``kino_dynamic_stages``, and their optimum."""

from __future__ import annotations

import numpy as np

from aerial_planner.formulation.contacts import footholds
from aerial_planner.formulation.kino_dynamic_stages import KinoDynamicStages, TakeOffKind
from aerial_planner.formulation.leg_inertia import LegInertia
from aerial_planner.formulation.limits import Margin, Variant
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.motion.schedule import Schedule
from aerial_planner.ocp.problem import Solution
from aerial_planner.ocp.stage import StageData
from aerial_planner.reference.body import Reference
from aerial_planner.reference.flight_path import FlightPath


class KinoDynamic(KinoDynamicStages):
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
            reference: what (3.4) measures deviations from, and where the motion starts.
            guess: where to start.
            near: the guess is the optimum of a similar problem, and within its limits.
            margin: shares of torque and voltage limits that may be used; None: the settings'.
        """
        margin = self._usual_margin if margin is None else margin
        inertia = LegInertia.on_intervals(self._whole, guess)
        solution = self.problem(schedule, near=near).solve(self._stages(schedule, reference, guess, margin, inertia))
        return self._trajectory(schedule, solution), solution

    def violation(
        self, schedule: Schedule, reference: Reference, trajectory: TakeOffTrajectory, guess: TakeOffTrajectory
    ) -> float:
        """Return by how much ``trajectory`` misses any constraint, SI units, torque limits of the take-off as at ``guess``."""
        inertia = LegInertia.on_intervals(self._whole, guess)
        stages = self._stages(schedule, reference, trajectory, self._usual_margin, inertia)
        return self.problem(schedule).violation(stages)

    @property
    def _usual_margin(self) -> Margin:
        return Margin.usual(self._whole, self.settings)

    @property
    def _speed_max(self) -> np.ndarray:
        """Greatest joint speeds ``(n,)`` [rad/s] (3.11a)."""
        if self.variant is Variant.KD:
            return np.full(self.robot.n_joints, np.inf)
        return self.settings.speed_margin * self.robot.actuators.no_load_speed

    def _stages(
        self,
        schedule: Schedule,
        reference: Reference,
        guess: TakeOffTrajectory,
        margin: Margin,
        inertia: LegInertia,
    ) -> list[StageData]:
        """Return parameters, bounds and guess of each knot."""
        feet = footholds(schedule, reference)
        x, x_min, x_max = self._take_off_states(schedule, reference, guess)
        p = self._take_off_parameters(schedule, reference, margin, inertia, feet)
        return [
            *self._take_off_data(schedule, guess, p, x, x_min, x_max),
            self._lift_off_data(schedule, reference, guess, margin, feet[-1], (x[-1], x_min[-1], x_max[-1])),
            *self._flight_data(schedule, reference, guess, margin),
        ]

    def _take_off_states(
        self, schedule: Schedule, reference: Reference, guess: TakeOffTrajectory
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return guess, least and greatest state of the knots on the ground ``(N+1, n_x)``, the lift-off's included."""
        N, n = len(schedule.contact), self.robot.n_joints
        rate = guess.joint_velocity
        stretch, *stretch_range = self._stretches(schedule, guess)
        layout = self.layouts.take_off_state
        x = layout.pack(
            r=guess.com,
            rdot=guess.com_velocity,
            alpha=guess.angular_momentum,
            quaternion=guess.orientation,
            q_j=guess.joint_position,
            dq_before=np.vstack([reference.start_joint_velocity, rate[: N - 1], rate[-1]]),
            stretch=stretch,
        )
        bounds = []
        for sign, joint_range, factor in zip((-1, 1), self.robot.planning_range, stretch_range, strict=True):
            q_j, dq_before = np.tile(joint_range, (N + 1, 1)), np.full((N + 1, n), sign * np.inf)
            q_j[0] = sign * np.inf  # the first knot's state is fixed
            dq_before[N] = sign * self._speed_max
            bounds.append(layout.filled(sign * np.inf, q_j=q_j, dq_before=dq_before, stretch=factor))
        return x, bounds[0], bounds[1]

    def _stretches(self, schedule: Schedule, guess: TakeOffTrajectory) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return guess and bounds of the factor of the time steps at each take-off knot; without columns if fixed."""
        if not self.timed:
            return (np.zeros((len(schedule.contact) + 1, 0)),) * 3
        least, greatest = np.vstack([schedule.stretch_range, schedule.stretch_range[-1:]]).T[..., None]
        stretch = np.append(guess.dt, guess.dt[-1])[:, None] / schedule.dt
        return np.clip(stretch, least, greatest), least, greatest

    def _take_off_parameters(
        self, schedule: Schedule, reference: Reference, margin: Margin, inertia: LegInertia, feet: np.ndarray
    ) -> np.ndarray:
        """Return the parameters of the take-off knots ``(N, n_p)``."""
        N = len(schedule.contact)
        return self.layouts.take_off_parameters.pack(
            dt=schedule.dt,
            r_ref=reference.com[:N],
            rdot_ref=reference.com_velocity[:N],
            quaternion_ref=reference.orientation[:N],
            q_j_ref=reference.joint_position[:N],
            q_j_frozen=reference.x_0[-self.robot.n_joints :],
            foot_ref=feet[:N].swapaxes(-1, -2),
            x_0=np.concatenate([reference.x_0, reference.start_joint_velocity]),
            margin=margin.take_off,
            H_joint=inertia.joint,
            H_wrench=inertia.wrench_share,
        )

    def _take_off_data(
        self,
        schedule: Schedule,
        guess: TakeOffTrajectory,
        p: np.ndarray,
        x: np.ndarray,
        x_min: np.ndarray,
        x_max: np.ndarray,
    ) -> list[StageData]:
        """Return the numbers of the take-off knots, from parameters and states of each."""
        stretch, stretch_min, stretch_max = self._stretches(schedule, guess)
        stages = []
        for k, kind in enumerate(self.take_off_kinds(schedule)):
            after = k + 1 if kind.ends_phase else slice(0)  # the next phase's factor, or none
            u = self.take_off_layout(kind).control.pack(
                omega=guess.angular_velocity[k],
                dq_j=guess.joint_velocity[k],
                f=guess.force[k][schedule.contact[k]].T,
                dq_end=guess.joint_velocity[-1][self.ending_joints(kind)] if kind.last else [],
                next_stretch=stretch[after].ravel(),
            )
            u_min = self._control_bound(kind, -np.inf, self.settings.force_min, stretch_min[after].ravel())
            u_max = self._control_bound(kind, np.inf, self.settings.force_max, stretch_max[after].ravel())
            stages.append(StageData(p=p[k], x=x[k], x_min=x_min[k], x_max=x_max[k], u=u, u_min=u_min, u_max=u_max))
        return stages

    def _control_bound(
        self, kind: TakeOffKind, unbounded: float, normal_force: float, next_stretch: np.ndarray
    ) -> np.ndarray:
        """Return the least or greatest control of a take-off knot; ``unbounded`` says which: minus or plus infinity."""
        tangential = [unbounded]
        return self.take_off_layout(kind).control.filled(
            unbounded,
            dq_j=np.copysign(self._speed_max, unbounded),
            f=np.tile([tangential, tangential, [normal_force]], sum(kind.contacts.loaded)),
            next_stretch=next_stretch,
        )

    def _lift_off_data(
        self,
        schedule: Schedule,
        reference: Reference,
        guess: TakeOffTrajectory,
        margin: Margin,
        feet: np.ndarray,
        states: tuple[np.ndarray, np.ndarray, np.ndarray],
    ) -> StageData:
        """Return the numbers of the lift-off knot, from footholds ``(n_c, 3)`` and guess, least and greatest state."""
        layout, path = self.layouts.lift_off, reference.flight_path
        arm_speed_max = self._speed_max[self.robot.arms]
        shortest, longest = schedule.flight_time_range
        p = layout.parameters.pack(
            dt=schedule.dt,
            foot_ref=feet.T,
            T_ref=schedule.flight_time,
            landing_com=reference.landing_com,
            **_path_parameters(path, 0),
            margin=margin.flight,
            H_flight=LegInertia.at(self._whole, guess.joint_position[-1:]).joint[0],
            onset=path.onset(schedule.flight_time),
        )
        u = layout.control.pack(
            omega=guess.flight_angular_velocity[0],
            omega_ground=guess.angular_velocity[-1],
            arm_rate=self._arm_rates(guess)[0],
            T=guess.flight_time,
        )
        u_min = layout.control.filled(-np.inf, arm_rate=-arm_speed_max, T=shortest)
        u_max = layout.control.filled(np.inf, arm_rate=arm_speed_max, T=longest)
        x, x_min, x_max = states
        return StageData(p=p, x=x, x_min=x_min, x_max=x_max, u=u, u_min=u_min, u_max=u_max)

    def _flight_data(
        self, schedule: Schedule, reference: Reference, guess: TakeOffTrajectory, margin: Margin
    ) -> list[StageData]:
        """Return the numbers of the knots from the first in the air to touchdown."""
        M, arms, layout = schedule.flight_knots, self.robot.arms, self.layouts.flight
        arm_rate, path = self._arm_rates(guess), reference.flight_path
        x = layout.state.pack(
            alpha=guess.angular_momentum[-1],
            quaternion=guess.flight_orientation[1:],
            q_j=guess.flight_joint_position[1:],
            T=guess.flight_time,
            arm_rate_before=arm_rate,
        )
        u = layout.control.pack(omega=guess.flight_angular_velocity[1:], arm_rate=arm_rate[1:])
        limits = self._flight_limits(path, guess, margin)
        bounds = {}
        for name, sign, joint_range in zip(("min", "max"), (-1, 1), self.robot.planning_range, strict=True):
            q_j = np.full(self.robot.n_joints, sign * np.inf)  # legs are on their path
            q_j[arms] = joint_range[arms]
            bounds[f"x_{name}"] = layout.state.filled(sign * np.inf, q_j=q_j)
            bounds[f"u_{name}"] = layout.control.filled(sign * np.inf, arm_rate=sign * self._speed_max[arms])
        stages = []
        for k in range(1, M):
            p = layout.parameters.pack(
                **_path_parameters(path, k),
                quaternion_ref=reference.flight_orientation[k],
                **{name: rows[k - 1] for name, rows in limits.items()},
            )
            stages.append(StageData.free(p=p, x=x[k - 1], u=u[k - 1], **bounds))
        p = self.layouts.touchdown.parameters.pack(goal=schedule.aim)
        stages.append(StageData.free(p=p, x=x[-1], x_min=bounds["x_min"], x_max=bounds["x_max"]))
        return stages

    def _arm_rates(self, guess: TakeOffTrajectory) -> np.ndarray:
        """Return the arms' mean rates on each interval of the flight ``(M, n_a)`` [rad/s]."""
        steps = np.diff(guess.flight_joint_position[:, self.robot.arms], axis=0)
        return np.asarray(steps * len(steps) / guess.flight_time)

    def _flight_limits(self, path: FlightPath, guess: TakeOffTrajectory, margin: Margin) -> dict[str, np.ndarray]:
        """Return the parameters of the torque limits at each flight knot after the lift-off's ``(M-1, ...)``."""
        M, joints, arms = len(path.fraction), self._limited_in_flight, self.robot.arms
        if len(joints) == 0:
            none = np.zeros((M - 1, 0))
            return {
                "H_arms": np.zeros((M - 1, 0, len(arms))),
                "tau_settling": none,
                "tau_folding": none,
                "margin": none,
            }
        legs = np.setdiff1d(np.arange(self.robot.n_joints), arms)
        T, start = guess.flight_time, guess.joint_position[-1]
        dt = T / M
        middle = (np.arange(M) + 0.5) * dt
        _, rate = path.at(start, middle, T)
        _, both = path.from_take_off(start, guess.joint_velocity[-1], middle, T)
        folding, total = np.diff(rate, axis=0) / dt, np.diff(both, axis=0) / dt  # (M-1, n)
        H = [along[joints] for along in LegInertia.at(self._whole, guess.flight_joint_position).joint[1:M]]
        settling = total - folding
        return {
            "H_arms": np.array([H_k[:, arms] for H_k in H]),
            "tau_settling": np.array([H_k[:, legs] @ tau[legs] for H_k, tau in zip(H, settling, strict=True)]),
            "tau_folding": np.array([H_k[:, legs] @ tau[legs] * T**2 for H_k, tau in zip(H, folding, strict=True)]),
            "margin": np.tile(margin.flight[joints], (M - 1, 1)),
        }

    def _trajectory(self, schedule: Schedule, solution: Solution) -> TakeOffTrajectory:
        """Return the trajectory of a solution."""
        N, M, layouts = len(schedule.contact), schedule.flight_knots, self.layouts
        x = layouts.take_off_state.unpack(np.array(solution.x[: N + 1]))
        u = [
            self.take_off_layout(kind).control.unpack(solution.u[k])
            for k, kind in enumerate(self.take_off_kinds(schedule))
        ]
        lift_off = layouts.lift_off.control.unpack(solution.u[N])
        flight_x = layouts.flight.state.unpack(np.array(solution.x[N + 1 :]))
        flight_u = layouts.flight.control.unpack(np.array(solution.u[N + 1 : N + M]))
        force = np.zeros((N, self.robot.n_contacts, 3))
        for k in range(N):
            force[k][schedule.contact[k]] = u[k]["f"].T
        return TakeOffTrajectory(
            dt=schedule.dt * (x["stretch"][:N, 0] if self.timed else np.ones(N)),
            com=x["r"],
            com_velocity=x["rdot"],
            angular_momentum=x["alpha"],
            orientation=x["quaternion"],
            joint_position=x["q_j"],
            angular_velocity=np.array([*(u_k["omega"] for u_k in u), lift_off["omega_ground"]]),
            joint_velocity=np.array([*(u_k["dq_j"] for u_k in u), x["dq_before"][N]]),
            flight_time=float(lift_off["T"]),
            force=force,
            flight_orientation=np.vstack([x["quaternion"][N], flight_x["quaternion"]]),
            flight_joint_position=np.vstack([x["q_j"][N], flight_x["q_j"]]),
            flight_angular_velocity=np.vstack([lift_off["omega"], flight_u["omega"]]),
        )


def _path_parameters(path: FlightPath, k: int) -> dict[str, np.ndarray]:
    """Return share, fraction and pose ahead of interval ``k`` of the flight by their names in the layout."""
    share, fraction, *pose_ahead = path.parameters(k)
    return {"share": share, "fraction": fraction, "pose_ahead": np.array(pose_ahead)}
