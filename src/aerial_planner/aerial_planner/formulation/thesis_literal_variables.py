"""The variables of (3.1) at every knot as an Opti problem has them, from a trajectory and back to one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from aerial_model.numerics import rotation
from aerial_model.robot.robot import GRAVITY, Robot
from aerial_planner.formulation.knots import mean_com
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.motion.schedule import Schedule


@dataclass(frozen=True, kw_only=True)
class LiteralVariables:
    """One column a knot: N + 1 on the ground, M + 1 in flight; positions and velocities in S, ω in B, SI units."""

    base: ca.MX  # (3, N+1)
    quaternion: ca.MX  # (4, N+1)
    q_j: ca.MX  # (n, N+1)
    base_velocity: ca.MX  # (3, N+1)
    omega: ca.MX  # (3, N+1)
    dq_j: ca.MX  # (n, N+1)
    r: ca.MX  # (3, N+1)
    rdot: ca.MX  # (3, N+1)
    rddot: ca.MX  # (3, N+1)
    alpha: ca.MX  # (3, N+1)
    alpha_dot: ca.MX  # (3, N+1)
    c: ca.MX  # (3 n_c, N+1)
    f: ca.MX  # (3 n_c, N+1)
    flight_quaternion: ca.MX  # (4, M+1)
    flight_q_j: ca.MX  # (n, M+1)
    flight_omega: ca.MX  # (3, M)
    flight_time: ca.MX  # (1, 1)

    @staticmethod
    def of(opti: ca.Opti, robot: Robot, schedule: Schedule) -> LiteralVariables:
        """Return new variables of a problem."""
        n, n_c, K, M = robot.n_joints, robot.n_contacts, len(schedule.contact) + 1, schedule.flight_knots
        return LiteralVariables(
            base=opti.variable(3, K),
            quaternion=opti.variable(4, K),
            q_j=opti.variable(n, K),
            base_velocity=opti.variable(3, K),
            omega=opti.variable(3, K),
            dq_j=opti.variable(n, K),
            r=opti.variable(3, K),
            rdot=opti.variable(3, K),
            rddot=opti.variable(3, K),
            alpha=opti.variable(3, K),
            alpha_dot=opti.variable(3, K),
            c=opti.variable(3 * n_c, K),
            f=opti.variable(3 * n_c, K),
            flight_quaternion=opti.variable(4, M + 1),
            flight_q_j=opti.variable(n, M + 1),
            flight_omega=opti.variable(3, M),
            flight_time=opti.variable(),
        )

    def values(
        self, guess: TakeOffTrajectory, model: BaseFrameModel, mass: float, dt: float
    ) -> Iterator[tuple[ca.MX, np.ndarray]]:
        """Return each variable with its values in a trajectory with time steps ``dt`` [s]."""
        N, n_c = guess.force.shape[:2]
        R = rotation.matrix(guess.orientation)
        base = guess.com - np.einsum("kab,kb->ka", R, model.coms(guess.joint_position))
        feet = base[:, None] + np.einsum("kab,kib->kia", R, model.feet_at(guess.joint_position))
        force = np.concatenate([guess.force, np.zeros((1, n_c, 3))])
        rddot = force.sum(axis=1) / mass - [0.0, 0.0, GRAVITY]
        rddot[-1] = 0.0
        centre = np.asarray(mean_com(ca.DM(guess.com.T), ca.DM(guess.com_velocity.T), ca.DM(dt))).T
        velocity = np.diff(base, axis=0) / dt
        rows = {
            "base": base,
            "quaternion": guess.orientation,
            "q_j": guess.joint_position,
            "base_velocity": np.vstack([velocity, velocity[-1:]]),
            "omega": guess.angular_velocity,
            "dq_j": guess.joint_velocity,
            "r": guess.com,
            "rdot": guess.com_velocity,
            "rddot": rddot,
            "alpha": guess.angular_momentum,
            "alpha_dot": np.cross(feet - centre[:, None], force).sum(axis=1),
            "c": feet.reshape(N + 1, -1),
            "f": force.reshape(N + 1, -1),
            "flight_quaternion": guess.flight_orientation,
            "flight_q_j": guess.flight_joint_position,
            "flight_omega": guess.flight_angular_velocity,
            "flight_time": np.array([[guess.flight_time]]),
        }
        return ((getattr(self, name), value.T) for name, value in rows.items())

    def trajectory(self, solution: ca.OptiSol, dt: float) -> TakeOffTrajectory:
        """Return the trajectory of a solution with time steps ``dt`` [s]."""

        def rows(variable: ca.MX) -> np.ndarray:
            return np.atleast_2d(solution.value(variable)).T

        force = rows(self.f)[:-1]
        return TakeOffTrajectory(
            dt=np.full(len(force), dt),
            com=rows(self.r),
            com_velocity=rows(self.rdot),
            angular_momentum=rows(self.alpha),
            orientation=rows(self.quaternion),
            joint_position=rows(self.q_j),
            angular_velocity=rows(self.omega),
            joint_velocity=rows(self.dq_j),
            force=force.reshape(len(force), -1, 3),
            flight_time=float(solution.value(self.flight_time)),
            flight_orientation=rows(self.flight_quaternion),
            flight_joint_position=rows(self.flight_q_j),
            flight_angular_velocity=rows(self.flight_omega),
        )
