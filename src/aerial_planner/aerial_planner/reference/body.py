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
from aerial_planner.settings import PlannerSettings

_TUCKED_AT = (
    0.3  # share of the flight after which the legs are tucked: early, as front feet meet a platform's edge first
)
_READY_AT = 0.9  # share of the flight after which they reach for the ground
_LIFT_OFF_RISE = 0.1  # of the centre of mass above its standing height, as a share of it: the reference's
_STRETCHED_RISE = 0.25  # the same, at the most: the legs' longest way to the tuck starts here
_FOLDING_SPEED = 0.55  # share of the no-load speed the legs may take; a short flight tucks less
_SMOOTH_STEP_PEAK = 1.5  # greatest slope of the smooth step
_LONG_SUPPORT = 0.4  # half the length of a support, over the height, that catches the robot by itself
_STOPPED = 0.4  # time in which a fall is stopped, over √(h/g)
_DROP_MAX, _DROP_STEP = 0.2, 0.02  # by which it may land lower, as a share of the height
_REACHED = 2e-3  # [m] that feet may miss in the landing pose
_PUSHED = 0.3  # share of the take-off that it lasts at lift-off speed, on average
_HARMLESS = (
    0.2  # part of the fall that legs' impact may take: to draw feet up for less turns a rolling body more than it saves
)
_LITTLE = 1e-3  # [m] by which feet are moved to see how the legs move
_NEARBY = 1e-9  # [m]


@dataclass(frozen=True, kw_only=True)
class FlightPath:
    """The legs' path through the flight: a smooth step to the tuck, one to the reach, then faster and faster to landing."""

    turning: int  # knot at which the legs are tucked
    ready: int  # knot at which they reach for the ground
    tuck: np.ndarray  # (n,) [rad]
    reach: np.ndarray  # (n,) [rad]
    landing: np.ndarray  # (n,) [rad]
    fraction: np.ndarray  # (M,) share of the remaining way to the pose ahead covered in each interval
    settling_time: float  # in which the legs' rates of the take-off die out [s]

    def parameters(self, k: int) -> np.ndarray:
        """Return share of the flight time, fraction and pose ahead of interval ``k`` as one vector ``(2 + n,)``."""
        pose = self.tuck if k < self.turning else self.reach if k < self.ready else self.landing
        return np.concatenate([[1 / len(self.fraction), self.fraction[k]], pose])

    def onset(self, flight_time: float) -> tuple[float, float]:
        """Return how the legs accelerate as a flight of T begins: by −a q̇ + b / T² (tuck − q), as (a [1/s], b [-])."""
        folding = self.turning / len(self.fraction)
        return 4.0 / min(self.settling_time, flight_time), 6.0 / folding**2

    def at_knots(self, start: np.ndarray) -> np.ndarray:
        """Return joint positions ``(M+1, n)`` [rad] at the knots, from a take-off pose."""
        return self.at(start, np.linspace(0.0, 1.0, len(self.fraction) + 1), 1.0)[0]

    def at(self, start: np.ndarray, time: np.ndarray, flight_time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return joint positions [rad] and rates [rad/s] ``(K, n)`` at ``time`` ``(K,)`` [s] from a take-off pose."""
        dt = flight_time / len(self.fraction)
        time = np.asarray(time)[:, None]
        turning, ready = self.turning * dt, self.ready * dt
        up, up_rate = _smooth_step(time / turning)
        down, down_rate = _smooth_step((time - turning) / (ready - turning))
        left = flight_time - ready
        back, back_rate = _run_up((time - ready) / left)
        ways = self.tuck - start, self.reach - self.tuck, self.landing - self.reach
        position = start + up * ways[0] + down * ways[1] + back * ways[2]
        rate = up_rate / turning * ways[0] + down_rate / (ready - turning) * ways[1] + back_rate / left * ways[2]
        return position, rate

    def from_take_off(
        self, start: np.ndarray, start_rate: np.ndarray, time: np.ndarray, flight_time: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the same from a take-off pose that the legs leave at ``start_rate`` ``(n,)`` [rad/s], which dies out."""
        position, rate = self.at(start, time, flight_time)
        settling = min(self.settling_time, flight_time)
        s = np.clip(time / settling, 0.0, 1.0)[:, None]
        position = position + settling * s * (1 - s) ** 2 * start_rate
        rate = rate + (1 - s) * (1 - 3 * s) * start_rate
        return position, rate


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
    start_joint_velocity: np.ndarray  # (n,) [rad/s]
    landing_com: np.ndarray  # (3,) of the centre of mass at touchdown [m]
    landing_com_height: float  # above the landing surface, to hold after landing [m]
    landing_joint_position: np.ndarray  # (n,) [rad]
    flight_path: FlightPath
    landing_speed: float  # over ground that the landing feet are set for [m/s]
    landing_lead_time: float  # by how much farther ahead they are set for each m/s of it [s]


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
    quaternion = start.q[BASE_ORIENTATION]
    R = rotation.matrix(quaternion)
    feet = robot.contact_positions(start.q)
    com_0 = feet[0] - R @ (model.feet_at(q_j[None])[0, 0] - model.coms(q_j[None])[0])
    landing_feet, height = _landing_stance(robot, model)

    landing_com = schedule.landing_centre + [0.0, 0.0, height]
    T = schedule.flight_time
    lift_off = com_0 + [0.0, 0.0, _LIFT_OFF_RISE * height]
    velocity = (landing_com - lift_off) / T + [0.0, 0.0, 0.5 * GRAVITY * T]
    R_landing = rotation.matrix(schedule.landing_orientation)
    home = robot.poses["home"][None]
    inertia = model.momenta(home, np.zeros_like(home))[0][0]
    turning_on = R_landing @ inertia @ R_landing.T @ schedule.rotation * (1 - schedule.rotation_at_lift_off) / T
    lead, lead_time, speed = _landing_lead(
        landing_feet @ R_landing.T, height, landing_com - lift_off, turning_on / robot.mass, schedule, settings
    )
    fall = 0.5 * GRAVITY * T - (landing_com - lift_off)[2] / T
    turning, ready = _turning_knots(schedule)
    share = 1 - ready / schedule.flight_knots  # of the flight, in which the feet are drawn up
    ahead = lead + schedule.arms_shift * [1.0, 1.0, 0.0]  # of the centre of mass with the arms at home
    landing = _landing(landing_feet + ahead @ R_landing, height, fall, T, share, robot, model, ik)
    landing_com = landing_com - lead - [0.0, 0.0, landing.drop - schedule.arms_shift[2]] - R_landing @ landing.miss

    stretched = ik.solve(((feet - com_0 - [0.0, 0.0, _STRETCHED_RISE * height]) @ R)[None], q_j)[0]
    N = len(schedule.contact)
    s = np.linspace(0.0, 1.0, N + 1)[:, None]
    com, com_velocity = _hermite(com_0, lift_off, velocity, schedule.take_off_time, s)
    turned, turn_rate = _turn(schedule, s[:, 0])
    turn = rotation.exp(turned[:, None] * schedule.rotation)
    R = rotation.matrix(rotation.multiply(turn, quaternion))
    omega = turn_rate[:, None] * schedule.rotation
    alpha = np.einsum("kab,bc,kdc,kd->ka", R, inertia, R, omega)
    flight_turned = turned[-1] + (1 - turned[-1]) * np.linspace(0.0, 1.0, schedule.flight_knots + 1)
    return Reference(
        com=com,
        com_velocity=com_velocity,
        angular_momentum=alpha,
        orientation=rotation.multiply(turn, quaternion),
        flight_orientation=rotation.multiply(rotation.exp(flight_turned[:, None] * schedule.rotation), quaternion),
        joint_position=np.tile(q_j, (N + 1, 1)),
        foot_position=np.tile(feet, (N + 1, 1, 1)),
        foot_clearance=_foot_clearance(schedule, settings),
        x_0=np.concatenate([com_0, *_start_momentum(robot, start), quaternion, q_j]),
        start_joint_velocity=start.v[JOINT_VELOCITY],
        landing_com=landing_com,
        landing_speed=speed,
        landing_lead_time=lead_time,
        landing_com_height=height,
        landing_joint_position=landing.pose,
        flight_path=_flight_path(
            schedule, robot, stretched, landing, turning, ready, max(settings.settling_time, schedule.folding_time)
        ),
    )


def _start_momentum(robot: Robot, start: Start) -> tuple[np.ndarray, np.ndarray]:
    """Return the velocity ``(3,)`` [m/s] of the centre of mass and the angular momentum ``(3,)`` [kg·m²/s] about it, in S."""
    momentum = pin.computeCentroidalMomentum(robot.model, robot.model.createData(), start.q, start.v)
    return momentum.linear / robot.mass, momentum.angular


def _landing_stance(robot: Robot, model: BaseFrameModel) -> tuple[np.ndarray, float]:
    """Return the feet ``(n_c, 3)`` from the centre of mass in the level landing pose, centred below it, and its height."""
    pose = robot.poses["landing"][None]
    feet = model.feet_at(pose)[0] - model.coms(pose)
    feet = feet - [*feet[:, :2].mean(axis=0), 0.0]
    radius = np.mean([point.radius for point in robot.contact_points])
    return feet, float(radius - feet[:, 2].mean())


def _landing_lead(
    feet: np.ndarray,
    height: float,
    way: np.ndarray,
    momentum: np.ndarray,
    schedule: Schedule,
    settings: PlannerSettings,
) -> tuple[np.ndarray, float, float]:
    """Return how far ``(3,)`` [m] the support is set off the centre of mass at touchdown, and what that hangs on.

    A support that is long for the height catches the robot where it lands, a little ahead. A short one has to be where
    the robot comes to rest: a force along the line from support to centre of mass that stops the fall w also takes
    w ℓ / h of the speed v, and as an inverted pendulum the rest would carry it √(h/g) times as far: with both,
    ℓ = v √(h/g) / (1 + w / √(g h)). What stops the fall also stops a turn α about a level axis, if it acts off the centre
    of mass by α × e_z / P, P = m (w + g t) with t the time the stop takes.

    Args:
        feet: ``(n_c, 3)`` [m] from the centre of mass, in S.
        height: of the centre of mass [m].
        way: of the centre of mass from standing to over the landing place ``(3,)`` [m].
        momentum: about the centre of mass at touchdown, over the mass ``(3,)``, in S [m²/s].
        schedule: of the motion.
        settings: of the planner.

    Returns:
        the way, how much farther it would be for each m/s of the speed over ground [s], and that speed [m/s].
    """
    distance, T = float(np.hypot(way[0], way[1])), schedule.flight_time
    fall, slow = abs(way[2] / T - 0.5 * GRAVITY * T), np.sqrt(GRAVITY * height)
    aside = np.cross(momentum, [0.0, 0.0, 1.0]) / (fall + _STOPPED * slow)
    lead = min(1.0, 2 * _falling(feet, height, aside)) * aside
    if distance < _NEARBY:
        return lead, 0.0, 0.0
    direction = np.array([way[0], way[1], 0.0]) / distance
    stopping = height / slow / (1 + fall / slow)
    little = settings.landing_lead * distance / T
    speed = schedule.landing_speed
    if speed is None:
        speed = distance / (T + _PUSHED * schedule.take_off_time + stopping)
    falling = _falling(feet, height, direction)
    lead = lead + (little + falling * max(stopping * speed - little, 0.0)) * direction
    return lead, falling * stopping, speed


def _falling(feet: np.ndarray, height: float, direction: np.ndarray) -> float:
    """Return to what extent a robot would fall over its feet ``(n_c, 3)`` [m] in a direction ``(3,)``: 0 to 1."""
    length = float(np.linalg.norm(direction))
    if length < _NEARBY:
        return 0.0
    half = float(np.ptp(feet @ direction)) / 2 / length
    return float(np.clip(1 - half / (_LONG_SUPPORT * height), 0.0, 1.0))


class _Landing(NamedTuple):
    """How the legs meet the ground."""

    reach: np.ndarray  # joint positions from which the feet are drawn up to meet it softly (n,) [rad]
    pose: np.ndarray  # joint positions at touchdown (n,) [rad]
    drop: float  # of the centre of mass at touchdown below its height in the landing pose [m]
    miss: np.ndarray  # of the feet's centre in this pose, from where it was to be (3,) in B [m]


def _landing(
    feet: np.ndarray,
    height: float,
    fall: float,
    flight_time: float,
    share: float,
    robot: Robot,
    model: BaseFrameModel,
    ik: InverseKinematics,
) -> _Landing:
    """Return a landing with the feet ``(n_c, 3)`` [m] from the centre of mass, in B, which comes at ``fall`` [m/s].

    Legs and rotors do not stop as one with the body: if they weigh μ of its mass at the feet, their impact takes
    μ / (1 + μ) of the fall at once, and throws a robot with straight legs or strong gears off the ground. So the feet
    are drawn up at that part of the fall when they touch the ground, evenly faster in the last ``share`` of the flight.
    Legs that do not reach so far ahead, or are too straight to be drawn up so fast, let the centre of mass come down
    lower: as little as will do, or where they need to be least fast if nothing will.
    """
    up = np.array([0.0, 0.0, 1.0])
    depths = np.arange(0.0, _DROP_MAX, _DROP_STEP) * height
    targets = feet + up * depths[:, None, None]
    poses = ik.solve(targets, robot.poses["landing"])
    per_metre = (ik.solve(targets + _LITTLE * up, poses) - poses) / _LITTLE  # [rad/m]
    rates = ((fall + depths / flight_time) * _rigid_share(robot, poses, per_metre))[:, None] * per_metre
    reaches = poses - 0.5 * share * flight_time * rates
    relative = model.feet_at(poses) - model.coms(poses)[:, None]
    misses = relative - targets  # (K, n_c, 3): legs do not reach as far as one might wish
    missing = np.linalg.norm(misses, axis=2).max(axis=1)
    low, high = robot.planning_range
    haste = np.max(np.abs(rates) / (_FOLDING_SPEED * robot.actuators.no_load_speed), axis=1)
    supple = np.all((low <= reaches) & (reaches <= high), axis=1) & (haste <= 1.0)
    reached = missing < _REACHED
    if np.any(reached & supple):
        best = int(np.argmax(reached & supple))
    else:
        best = int(np.argmin(np.where(reached, haste, np.inf)) if reached.any() else np.argmin(missing))
    return _Landing(np.clip(reaches[best], low, high), poses[best], float(depths[best]), misses[best].mean(axis=0))


def _rigid_share(robot: Robot, poses: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return μ / (1 + μ) ``(K,)`` of legs in ``poses`` that move by ``rates`` [rad/m], both ``(K, n)``, as their feet do.

    It is 0 where the impact is harmless.
    """
    M = robot.mass_matrices(poses)[:, JOINT_VELOCITY, JOINT_VELOCITY]
    mu = np.einsum("ki,kij,kj->k", rates, M, rates) / robot.mass
    share = mu / (1 + mu)
    return np.where(share < _HARMLESS, 0.0, share)


def _foot_clearance(schedule: Schedule, settings: PlannerSettings) -> np.ndarray:
    """Return the height ``(N+1, n_c)`` [m] over where they stood that feet in the air keep while others push.

    Without it the optimum lets them hover on the ground, where the least error of the attitude makes them push.
    """
    lifted = schedule.dt * np.vstack([np.zeros_like(schedule.contact[:1]), np.cumsum(~schedule.contact, axis=0)])  # [s]
    return settings.swing_clearance * np.clip(lifted / settings.swing_rise_time, 0.0, 1.0)


def _hermite(
    start: np.ndarray, end: np.ndarray, velocity: np.ndarray, duration: float, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities of the cubic from rest at ``start`` to ``end`` with ``velocity``, at s ∈ [0, 1]."""
    position = start + (3 * s**2 - 2 * s**3) * (end - start) + (s**3 - s**2) * duration * velocity
    rate = (6 * s - 6 * s**2) / duration * (end - start) + (3 * s**2 - 2 * s) * velocity
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


def _turning_knots(schedule: Schedule) -> tuple[int, int]:
    """Return the knots at which the legs are tucked, and at which they reach for the ground."""
    M = schedule.flight_knots
    ready = max(2, round(_READY_AT * M))
    folding = int(np.ceil(schedule.folding_time / schedule.flight_time * M))
    return min(max(_usual_turning(M), folding), ready - 1), ready


def _usual_turning(M: int) -> int:
    return max(1, round(_TUCKED_AT * M))


def _flight_path(
    schedule: Schedule,
    robot: Robot,
    stretched: np.ndarray,
    landing: _Landing,
    turning: int,
    ready: int,
    settling_time: float,
) -> FlightPath:
    """Return the path that tucks as far as the legs can fold and stretch in time."""
    reach = landing.reach
    M, dt = schedule.flight_knots, schedule.flight_time_range[0] / schedule.flight_knots
    travel = _FOLDING_SPEED * robot.actuators.no_load_speed * dt / _SMOOTH_STEP_PEAK  # per interval (n,) [rad]
    fold = robot.poses["tuck"] - reach
    depth = (
        (ready - turning) / (ready - _usual_turning(M))
    ) ** 2  # of the tuck: legs that fold slowly unfold no faster
    for way, intervals in ((reach - stretched, turning), (np.zeros_like(reach), ready - turning)):
        # |way + depth · fold| ≤ travel · intervals, joint by joint
        room = np.sign(fold) * -way + travel * intervals
        folding = np.abs(fold) > 0
        depth = min(depth, *np.clip(room[folding] / np.abs(fold[folding]), 0.0, 1.0))
    tuck = reach + depth * fold
    fraction = np.zeros(M)
    for first, last, course in ((0, turning, _smooth_step), (turning, ready, _smooth_step), (ready, M, _run_up)):
        way, _ = course(np.linspace(0.0, 1.0, last - first + 1))
        fraction[first:last] = np.diff(way) / (1 - way[:-1])
    return FlightPath(
        turning=turning,
        ready=ready,
        tuck=tuck,
        reach=reach,
        landing=landing.pose,
        fraction=fraction,
        settling_time=settling_time,
    )


def _smooth_step(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return 3s² − 2s³ and its derivative, s held to [0, 1]."""
    s = np.clip(s, 0.0, 1.0)
    return s**2 * (3 - 2 * s), 6 * s * (1 - s)


def _run_up(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return s² and its derivative, s held to [0, 1]."""
    s = np.clip(s, 0.0, 1.0)
    return s**2, 2 * s
