"""The kinematic reference of a motion (thesis section 3.2): where the body should roughly be; it may be infeasible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerial_model import rotation
from aerial_model.robot import BASE_ORIENTATION, JOINT_POSITION, Robot
from aerial_planner.inverse_kinematics import InverseKinematics
from aerial_planner.schedule import GRAVITY, Schedule
from aerial_planner.settings import PlannerSettings
from aerial_planner.symbolic import BaseFrameModel

_TUCKED_AT = 0.45  # share of the flight after which the legs are tucked
_READY_AT = 0.9  # share of the flight after which they are in the landing pose


@dataclass(frozen=True, kw_only=True)
class FlightPath:
    """The legs' path through the flight: towards the tuck, then towards the landing pose, without a jerk at either."""

    dt: float  # [s]
    fraction: np.ndarray  # (M,) share of the remaining way to the target covered in each interval
    target: np.ndarray  # (M, n) pose each interval moves towards [rad]

    def parameters(self, k: int) -> np.ndarray:
        """Return dt, fraction and target of interval ``k`` as one vector."""
        return np.concatenate([[self.dt, self.fraction[k]], self.target[k]])

    def joint_positions(self, start: np.ndarray) -> np.ndarray:
        """Return the path ``(M+1, n)`` [rad] from a take-off pose ``(n,)``."""
        q = [start]
        for fraction, target in zip(self.fraction, self.target, strict=True):
            q.append(q[-1] + fraction * (target - q[-1]))
        return np.array(q)


@dataclass(frozen=True, kw_only=True)
class Reference:
    """Reference of N + 1 take-off knots and the data of the flight, in S."""

    com: np.ndarray  # (N+1, 3) [m]
    com_velocity: np.ndarray  # (N+1, 3) [m/s]
    orientation: np.ndarray  # (N+1, 4)
    joint_position: np.ndarray  # (N+1, n) [rad]
    foot_position: np.ndarray  # (n_c, 3) of the standing robot [m]
    x_0: np.ndarray  # (13 + n,) initial state r, ṙ, α, quaternion, q_j
    landing_com: np.ndarray  # (3,) of the centre of mass at touchdown, led by its velocity [m]
    landing_com_height: float  # above the landing surface, to hold after landing [m]
    landing_joint_position: np.ndarray  # (n,) [rad]
    flight_path: FlightPath


def body_reference(
    schedule: Schedule,
    q_start: np.ndarray,
    robot: Robot,
    model: BaseFrameModel,
    ik: InverseKinematics,
    settings: PlannerSettings,
) -> Reference:
    """Return the reference of a schedule for a robot that stands at ``q_start`` ``(nq,)`` in S, at rest."""
    q_j = q_start[JOINT_POSITION]
    quaternion = q_start[BASE_ORIENTATION]
    R = rotation.matrix(quaternion)
    feet = robot.contact_positions(q_start)
    com_0 = feet[0] - R @ (np.asarray(model.feet(q_j))[:, 0] - np.asarray(model.com(q_j)).ravel())
    landing_feet, height = _landing_stance(robot, model)

    landing_com = schedule.landing_centre + [0.0, 0.0, height]
    T = schedule.flight_time
    lift_off = com_0 + [0.0, 0.0, 0.1 * height]
    velocity = (landing_com - lift_off) / T + [0.0, 0.0, 0.5 * GRAVITY * T]
    lead = settings.landing_lead * np.array([velocity[0], velocity[1], 0.0])
    R_landing = rotation.matrix(schedule.landing_orientation)
    landing_pose = ik.solve((landing_feet + lead @ R_landing)[None], robot.poses["landing"])[0]

    N = len(schedule.contact)
    s = np.linspace(0.0, 1.0, N + 1)[:, None]
    com, com_velocity = _hermite(com_0, lift_off, velocity, schedule.take_off_time, s)
    return Reference(
        com=com,
        com_velocity=com_velocity,
        orientation=np.tile(quaternion, (N + 1, 1)),
        joint_position=np.tile(q_j, (N + 1, 1)),
        foot_position=feet,
        x_0=np.concatenate([com_0, np.zeros(6), quaternion, q_j]),
        landing_com=landing_com,
        landing_com_height=height,
        landing_joint_position=landing_pose,
        flight_path=_flight_path(schedule, robot.poses["tuck"], landing_pose),
    )


def _landing_stance(robot: Robot, model: BaseFrameModel) -> tuple[np.ndarray, float]:
    """Return the feet ``(n_c, 3)`` from the centre of mass in the level landing pose, centred below it, and its height."""
    pose = robot.poses["landing"]
    feet = np.asarray(model.feet(pose)).T - np.asarray(model.com(pose)).ravel()
    feet = feet - [*feet[:, :2].mean(axis=0), 0.0]
    radius = np.mean([point.radius for point in robot.contact_points])
    return feet, float(radius - feet[:, 2].mean())


def _hermite(
    start: np.ndarray, end: np.ndarray, velocity: np.ndarray, duration: float, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities of the cubic from rest at ``start`` to ``end`` with ``velocity``, at s ∈ [0, 1]."""
    position = start + (3 * s**2 - 2 * s**3) * (end - start) + (s**3 - s**2) * duration * velocity
    rate = (6 * s - 6 * s**2) / duration * (end - start) + (3 * s**2 - 2 * s) * velocity
    return position, rate


def _flight_path(schedule: Schedule, tuck: np.ndarray, landing: np.ndarray) -> FlightPath:
    M = schedule.flight_knots
    turning = max(1, round(_TUCKED_AT * M))
    ready = max(turning + 1, round(_READY_AT * M))
    fraction, target = np.zeros(M), np.tile(landing, (M, 1))
    fraction[:turning] = _smooth_fractions(turning)
    target[:turning] = tuck
    fraction[turning:ready] = _smooth_fractions(ready - turning)
    return FlightPath(dt=schedule.flight_time / M, fraction=fraction, target=target)


def _smooth_fractions(intervals: int) -> np.ndarray:
    """Return the share of the remaining way covered in each interval when the whole way is a smooth step."""
    s = np.linspace(0.0, 1.0, intervals + 1)
    way = s**2 * (3 - 2 * s)
    return np.diff(way) / (1 - way[:-1])
