"""The kinematic reference of a motion (thesis section 3.2): where the body should roughly be; it may be infeasible."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, GRAVITY, JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.kinematics.inverse_kinematics import InverseKinematics
from aerial_planner.motion.schedule import Schedule
from aerial_planner.motion.start import Start
from aerial_planner.reference.flight_path import FlightPath, flight_path, turning_knots
from aerial_planner.reference.landing import Landing, Lead, landing_lead, landing_posture, landing_support
from aerial_planner.settings import PlannerSettings

_LIFT_OFF_RISE = 0.1  # of the centre of mass above its standing height, as a share of it: the reference's
_STRETCHED_RISE = (
    0.25  # of the centre of mass with the longest legs, as a share of its height: their path to the tuck starts here
)


@dataclass(frozen=True, kw_only=True)
class Reference:
    """Reference of N + 1 take-off knots and the data of the flight, in S."""

    com: np.ndarray  # (N+1, 3) [m]
    com_velocity: np.ndarray  # (N+1, 3) [m/s]
    angular_momentum: np.ndarray  # (N+1, 3) [kg·m²/s]
    orientation: np.ndarray  # (N+1, 4)
    flight_orientation: np.ndarray  # (M+1, 4)
    joint_position: np.ndarray  # (N+1, n) [rad]
    foot_position: np.ndarray  # (N+1, n_c, 3) of points that bear load the foothold, of others what they are above [m]
    foot_clearance: np.ndarray  # (N+1, n_c) height over ``foot_position`` that feet in the air keep [m]
    x_0: np.ndarray  # (13 + n,) initial state r, ṙ, α, quaternion, q_j
    start_velocity: np.ndarray  # (nv,) v as the motion starts
    landing_com: np.ndarray  # (3,) of the centre of mass at touchdown [m]
    landing_com_height: float  # above the landing surface, to hold after landing [m]
    landing_joint_position: np.ndarray  # (n,) [rad]
    flight_path: FlightPath
    landing_speed: float  # over ground that the landing feet are set for [m/s]
    landing_lead_time: float  # by how much farther ahead they are set for each m/s of it [s]

    @property
    def start_joint_velocity(self) -> np.ndarray:
        """Joint rates ``(n,)`` [rad/s] as the motion starts."""
        return self.start_velocity[JOINT_VELOCITY]


class _Body(NamedTuple):
    """The single rigid body as the motion starts: all links in the home pose."""

    com: np.ndarray  # (3,) [m]
    com_velocity: np.ndarray  # (3,) [m/s]
    angular_momentum: np.ndarray  # (3,) [kg·m²/s]
    orientation: np.ndarray  # (4,)
    inertia: np.ndarray  # (3, 3) about the centre of mass, in B [kg·m²]
    feet: np.ndarray  # (n_c, 3) contact points [m]


class _Flight(NamedTuple):
    """The ballistic path of the reference."""

    lift_off: np.ndarray  # (3,) centre of mass as the last contact ends [m]
    velocity: np.ndarray  # (3,) there [m/s]
    landing_com: np.ndarray  # (3,) centre of mass at touchdown [m]
    height: float  # of it in the landing pose, above the surface [m]
    lead: Lead
    landing: Landing


def body_reference(
    schedule: Schedule,
    start: Start,
    robot: Robot,
    model: BaseFrameModel,
    ik: InverseKinematics,
    settings: PlannerSettings,
) -> Reference:
    """Return the reference of a schedule from a start of ``robot``."""
    q_j = start.q[JOINT_POSITION]
    body = _body(start, robot, model)
    flight = _flight(schedule, body, robot, model, ik, settings)
    stretched = ik.solve(_feet_of_stretched_legs(body, flight.height)[None], q_j)[0]
    s = np.linspace(0.0, 1.0, len(schedule.contact) + 1)
    com, com_velocity = _hermite(
        body.com, body.com_velocity, flight.lift_off, flight.velocity, schedule.take_off_time, s[:, None]
    )
    turned, turn_rate = _turn(schedule, s)
    orientation = _turned_by(turned, schedule, body.orientation)
    flight_turned = turned[-1] + (1 - turned[-1]) * np.linspace(0.0, 1.0, schedule.flight_knots + 1)
    return Reference(
        com=com,
        com_velocity=com_velocity,
        angular_momentum=_angular_momentum(body.inertia, orientation, turn_rate[:, None] * schedule.rotation),
        orientation=orientation,
        flight_orientation=_turned_by(flight_turned, schedule, body.orientation),
        joint_position=np.tile(q_j, (len(s), 1)),
        foot_position=_foot_position(schedule, body.feet, robot),
        foot_clearance=_foot_clearance(schedule, settings),
        x_0=np.concatenate([body.com, body.com_velocity, body.angular_momentum, body.orientation, q_j]),
        start_velocity=start.v,
        landing_com=flight.landing_com,
        landing_speed=flight.lead.speed,
        landing_lead_time=flight.lead.time,
        landing_com_height=flight.height,
        landing_joint_position=flight.landing.pose,
        flight_path=flight_path(
            schedule, robot, stretched, flight.landing, max(settings.settling_time, schedule.folding_time)
        ),
    )


def _body(start: Start, robot: Robot, model: BaseFrameModel) -> _Body:
    """Return the single rigid body of a start."""
    q_j, quaternion = start.q[JOINT_POSITION], start.q[BASE_ORIENTATION]
    feet = robot.contact_positions(start.q)
    R = rotation.matrix(quaternion)
    home = robot.poses["home"][None]
    momentum = pin.computeCentroidalMomentum(robot.model, robot.model.createData(), start.q, start.v)
    return _Body(
        com=feet[0] - R @ (model.feet_at(q_j[None])[0, 0] - model.coms(q_j[None])[0]),
        com_velocity=momentum.linear / robot.mass,
        angular_momentum=momentum.angular,
        orientation=quaternion,
        inertia=model.momenta(home, np.zeros_like(home))[0][0],
        feet=feet,
    )


def _flight(
    schedule: Schedule,
    body: _Body,
    robot: Robot,
    model: BaseFrameModel,
    ik: InverseKinematics,
    settings: PlannerSettings,
) -> _Flight:
    """Return the ballistic path to a landing whose feet's centre is at the goal."""
    T = schedule.flight_time
    support = landing_support(robot, model)
    landing_com = schedule.landing_centre + [0.0, 0.0, support.height]
    carried = body.com_velocity * [1.0, 1.0, 0.0] * schedule.take_off_time
    lift_off = body.com + [0.0, 0.0, _LIFT_OFF_RISE * support.height] + carried
    displacement = landing_com - lift_off
    velocity = displacement / T + [0.0, 0.0, 0.5 * GRAVITY * T]
    R_landing = rotation.matrix(schedule.landing_orientation)
    turning_on = R_landing @ body.inertia @ R_landing.T @ schedule.rotation * (1 - schedule.rotation_at_lift_off) / T
    turned = support._replace(feet=support.feet @ R_landing.T)
    lead = landing_lead(turned, displacement, turning_on / robot.mass, schedule, settings)
    fall = 0.5 * GRAVITY * T - displacement[2] / T
    share = 1 - turning_knots(schedule)[1] / schedule.flight_knots  # of the flight, in which the feet are drawn up
    ahead = lead.offset + schedule.arms_shift * [1.0, 1.0, 0.0]  # of the centre of mass with the arms at home
    feet = support.feet + ahead @ R_landing
    landing = landing_posture(feet, support.height, fall, T, share, robot, model, ik)
    below = np.array([0.0, 0.0, landing.drop - schedule.arms_shift[2]])
    landing_com = landing_com - lead.offset - below - R_landing @ landing.miss
    return _Flight(lift_off, velocity, landing_com, support.height, lead, landing)


def _feet_of_stretched_legs(body: _Body, height: float) -> np.ndarray:
    """Return the feet ``(n_c, 3)`` [m] from the centre of mass, in B, of a body as high as the legs are at their longest."""
    return (body.feet - body.com - [0.0, 0.0, _STRETCHED_RISE * height]) @ rotation.matrix(body.orientation)


def _foot_position(schedule: Schedule, feet: np.ndarray, robot: Robot) -> np.ndarray:
    """Return where each point stands, or what it is above, at the take-off knots ``(N+1, n_c, 3)`` [m].

    A point in the air is above a place that moves evenly from its last foothold to its next one, or stays at the last.
    One that is in the air at the start begins on the ground below, which is as high as that of the points that bear load.

    Args:
        schedule: of the motion.
        feet: contact points as the motion starts ``(n_c, 3)`` [m].
        robot: whose contact points they are.
    """
    N = len(schedule.contact)
    position = np.tile(feet, (N + 1, 1, 1))
    if schedule.foothold is None:
        return position
    radii = np.array([point.radius for point in robot.contact_points])
    loaded = schedule.contact[0]
    ground = float(np.mean(feet[loaded, 2] - radii[loaded]))
    for i in range(robot.n_contacts):
        places = {0: feet[i] if loaded[i] else np.array([feet[i, 0], feet[i, 1], ground + radii[i]])}
        for k in np.flatnonzero(schedule.contact[:, i]).tolist():
            places[k] = places[k + 1] = schedule.foothold[k, i]
        for axis in range(3):
            course = [place[axis] for place in places.values()]
            position[:, i, axis] = np.interp(np.arange(N + 1), list(places), course)
    return position


def _foot_clearance(schedule: Schedule, settings: PlannerSettings) -> np.ndarray:
    """Return the height ``(N+1, n_c)`` [m] that feet in the air keep while others push, near footholds less.

    Without it the optimum lets them hover on the ground, where the least error of the attitude makes them push.
    """
    knots = np.minimum(_knots_in_the_air(schedule.contact), _knots_to_landing(schedule.contact))
    return settings.swing_clearance * np.clip(schedule.dt * knots / settings.swing_rise_time, 0.0, 1.0)


def _knots_in_the_air(contact: np.ndarray) -> np.ndarray:
    """Return for how many intervals each point has been in the air at each knot ``(N+1, n_c)``."""
    count = np.zeros((len(contact) + 1, contact.shape[1]))
    for k, loaded in enumerate(contact):
        count[k + 1] = np.where(loaded, 0.0, count[k] + 1)
    return count


def _knots_to_landing(contact: np.ndarray) -> np.ndarray:
    """Return in how many intervals each point will bear load at each knot ``(N+1, n_c)``; infinite if it will not."""
    count = np.full((len(contact) + 1, contact.shape[1]), np.inf)
    for k in reversed(range(len(contact))):
        count[k] = np.where(contact[k], 0.0, count[k + 1] + 1)
    return count


def _hermite(
    start: np.ndarray,
    start_velocity: np.ndarray,
    end: np.ndarray,
    end_velocity: np.ndarray,
    duration: float,
    s: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities ``(K, 3)`` of the cubic between two states, at s ``(K, 1)`` ∈ [0, 1]."""
    position = start + (3 * s**2 - 2 * s**3) * (end - start) + (s**3 - s**2) * duration * end_velocity
    rate = (6 * s - 6 * s**2) / duration * (end - start) + (3 * s**2 - 2 * s) * end_velocity
    position = position + (s - 2 * s**2 + s**3) * duration * start_velocity
    rate = rate + (1 - 4 * s + 3 * s**2) * start_velocity
    return position, rate


def _turn(schedule: Schedule, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how much of the rotation the reference has behind it, as a share, and its rate [1/s], at s ∈ [0, 1].

    The rate rises evenly from the moment that lets the share at lift-off be reached with the rate the flight needs.
    """
    share = schedule.rotation_at_lift_off
    rate = (1 - share) / schedule.flight_time
    rising = min(2 * share / rate, schedule.take_off_time) if share > 0 else schedule.take_off_time
    time = np.clip(schedule.take_off_time * (s - 1) + rising, 0.0, None)
    if share == 0.0:
        return np.zeros_like(s), rate * (time / rising)
    return share * (time / rising) ** 2, rate * (time / rising)


def _turned_by(share: np.ndarray, schedule: Schedule, orientation: np.ndarray) -> np.ndarray:
    """Return attitudes ``(K, 4)`` after shares ``(K,)`` of the rotation, from the one the motion starts in."""
    return rotation.multiply(rotation.exp(share[:, None] * schedule.rotation), orientation)


def _angular_momentum(inertia: np.ndarray, orientation: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Return R I Rᵀ ω ``(K, 3)`` [kg·m²/s] at attitudes ``(K, 4)`` and rates ``(K, 3)`` [rad/s], in S."""
    R = rotation.matrix(orientation)
    return np.einsum("kab,bc,kdc,kd->ka", R, inertia, R, omega)
