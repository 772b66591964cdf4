"""How the legs meet the ground: where the support is set, in which pose, and how fast the feet are drawn up."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.robot.robot import GRAVITY, JOINT_VELOCITY, Robot
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.kinematics.inverse_kinematics import InverseKinematics
from aerial_planner.motion.schedule import Schedule
from aerial_planner.settings import PlannerSettings

_LONG_SUPPORT = 0.4  # half the length of a support, over the height, that catches the robot by itself
_STOPPING_TIME = 0.4  # in which a fall is stopped, over √(h/g)
_DROP_MAX, _DROP_STEP = 0.2, 0.02  # by which it may land lower, as a share of the height
_REACHED = 2e-3  # [m] that feet may miss in the landing pose
_PUSH_SHARE = 0.3  # of the take-off's time: that at lift-off speed which takes a robot as far
# Part of the fall that the legs' impact may take: to draw feet up for less turns a rolling body more than it saves.
_NEGLIGIBLE_IMPACT = 0.2
FOLDING_SPEED = 0.55  # share of the no-load speed that legs may take in flight; a short one tucks less
_PROBE = 1e-3  # [m] by which feet are moved to find the joints' displacement for it
_NEARBY = 1e-9  # [m]


class Support(NamedTuple):
    """The level landing stance, from its centre of mass."""

    feet: np.ndarray  # (n_c, 3) of the contact points, centred below it [m]
    height: float  # of the centre of mass above the ground [m]


class Lead(NamedTuple):
    """Where the support is set, from below the centre of mass at touchdown."""

    offset: np.ndarray  # (3,) in S [m]
    time: float  # by how much farther ahead it is set for each m/s over ground [s]
    speed: float  # over ground that it is set for [m/s]


class Landing(NamedTuple):
    """How the legs meet the ground."""

    reach: np.ndarray  # joint positions from which the feet are drawn up to meet it softly (n,) [rad]
    pose: np.ndarray  # joint positions at touchdown (n,) [rad]
    drop: float  # of the centre of mass at touchdown below its height in the landing pose [m]
    miss: np.ndarray  # of the feet's centre in this pose, from where it was to be (3,) in B [m]


def landing_support(robot: Robot, model: BaseFrameModel) -> Support:
    """Return the feet and the height of the centre of mass in the robot's level landing pose."""
    pose = robot.poses["landing"][None]
    feet = model.feet_at(pose)[0] - model.coms(pose)
    feet = feet - [*feet[:, :2].mean(axis=0), 0.0]
    radius = np.mean([point.radius for point in robot.contact_points])
    return Support(feet, float(radius - feet[:, 2].mean()))


def landing_lead(
    support: Support, displacement: np.ndarray, momentum: np.ndarray, schedule: Schedule, settings: PlannerSettings
) -> Lead:
    """Return how far the support is set off the centre of mass at touchdown, and what that hangs on.

    A support that is long for the height catches the robot where it lands, a little ahead. A short one has to be where
    the robot comes to rest: a force along the line from support to centre of mass that stops the fall w also takes
    w ℓ / h of the speed v, and as an inverted pendulum the rest would carry it √(h/g) times as far: with both,
    ℓ = v √(h/g) / (1 + w / √(g h)). What stops the fall also stops a turn α about a level axis, if it acts off the centre
    of mass by α × e_z / P, P = m (w + g t) with t the time the stop takes.

    Args:
        support: with the feet as they are turned at touchdown, in S.
        displacement: of the centre of mass from lift-off to over the landing place ``(3,)`` [m].
        momentum: about the centre of mass at touchdown, over the mass ``(3,)``, in S [m²/s].
        schedule: of the motion.
        settings: of the planner.
    """
    feet, height = support
    distance, T = float(np.hypot(displacement[0], displacement[1])), schedule.flight_time
    fall, slow = abs(displacement[2] / T - 0.5 * GRAVITY * T), np.sqrt(GRAVITY * height)
    aside = np.cross(momentum, [0.0, 0.0, 1.0]) / (fall + _STOPPING_TIME * slow)
    lead = min(1.0, 2 * _falling(feet, height, aside)) * aside
    if distance < _NEARBY:
        return Lead(lead, 0.0, 0.0)
    direction = np.array([displacement[0], displacement[1], 0.0]) / distance
    stopping = height / slow / (1 + fall / slow)
    least = settings.landing_lead * distance / T
    speed = schedule.landing_speed
    if speed is None:
        speed = distance / (T + _PUSH_SHARE * schedule.take_off_time + stopping)
    falling = _falling(feet, height, direction)
    lead = lead + (least + falling * max(stopping * speed - least, 0.0)) * direction
    return Lead(lead, falling * stopping, speed)


def landing_posture(
    feet: np.ndarray,
    height: float,
    fall: float,
    flight_time: float,
    share: float,
    robot: Robot,
    model: BaseFrameModel,
    ik: InverseKinematics,
) -> Landing:
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
    per_metre = (ik.solve(targets + _PROBE * up, poses) - poses) / _PROBE  # [rad/m]
    rates = ((fall + depths / flight_time) * _rigid_share(robot, poses, per_metre))[:, None] * per_metre
    reaches = poses - 0.5 * share * flight_time * rates
    relative = model.feet_at(poses) - model.coms(poses)[:, None]
    misses = relative - targets  # (K, n_c, 3): legs do not reach as far as one might wish
    missing = np.linalg.norm(misses, axis=2).max(axis=1)
    low, high = robot.planning_range
    haste = np.max(np.abs(rates) / (FOLDING_SPEED * robot.actuators.no_load_speed), axis=1)
    supple = np.all((low <= reaches) & (reaches <= high), axis=1) & (haste <= 1.0)
    reached = missing < _REACHED
    if np.any(reached & supple):
        best = int(np.argmax(reached & supple))
    else:
        best = int(np.argmin(np.where(reached, haste, np.inf)) if reached.any() else np.argmin(missing))
    return Landing(np.clip(reaches[best], low, high), poses[best], float(depths[best]), misses[best].mean(axis=0))


def _falling(feet: np.ndarray, height: float, direction: np.ndarray) -> float:
    """Return to what extent a robot would fall over its feet ``(n_c, 3)`` [m] in a direction ``(3,)``: 0 to 1."""
    length = float(np.linalg.norm(direction))
    if length < _NEARBY:
        return 0.0
    half = float(np.ptp(feet @ direction)) / 2 / length
    return float(np.clip(1 - half / (_LONG_SUPPORT * height), 0.0, 1.0))


def _rigid_share(robot: Robot, poses: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return μ / (1 + μ) ``(K,)`` of legs in ``poses`` that move by ``rates`` [rad/m], both ``(K, n)``, as their feet do.

    It is 0 where the impact is negligible.
    """
    M = robot.mass_matrices(poses)[:, JOINT_VELOCITY, JOINT_VELOCITY]
    mu = np.einsum("ki,kij,kj->k", rates, M, rates) / robot.mass
    share = mu / (1 + mu)
    return np.where(share < _NEGLIGIBLE_IMPACT, 0.0, share)
