"""From a request to its contact schedule: which contact point carries load when, how long the flight is, where it ends."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from aerial_model.errors import ConfigurationError, RefusalCode, RefusalError
from aerial_model.numerics import rotation
from aerial_model.robot.robot import GRAVITY, Robot
from aerial_model.values.contact_sequence import ContactSequence
from aerial_model.values.request import MotionRequest
from aerial_planner.motion.motion import Motion

_CLEARANCE_SPARED = 0.6  # share of the clearance the optimizer may do without where it binds
_FLIGHT_TIME_STRETCH = 1.2  # longest flight over the nominal one
_SIDES = {"front": (0, 1), "rear": (0, -1), "left": (1, 1), "right": (1, -1)}  # axis and sign, seen from the centre


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """The discrete skeleton of one plan."""

    dt: float  # of the take-off knots [s]
    contact: np.ndarray  # (N, n_c) bool: contact on [t_k, t_k+1), all of the take-off
    phase: np.ndarray  # (N,) int: which phase of the take-off
    stretch_range: np.ndarray  # (N, 2) least and greatest factor of dt, one for all of a phase, if timing is optimized
    foothold: np.ndarray | None = None  # (N, n_c, 3) of points that bear load, in S [m]; None: where they start
    flight_time: float  # that the optimizer should stay near [s]
    flight_time_range: tuple[float, float]  # that it must stay in [s]
    flight_knots: int  # intervals the flight is integrated with
    landing_centre: np.ndarray  # (3,) of the support at landing, in S, z: the surface [m]
    rotation: np.ndarray  # (3,) to accumulate from start to touchdown, as a rotation vector in S [rad]
    rotation_at_lift_off: float = 0.0  # share of it that the reference has behind it at lift-off
    # (3,) of the attitude to aim at, a rotation vector in the landed base [rad]
    correction: np.ndarray = field(default_factory=lambda: np.zeros(3))
    # (3,) of the centre of mass at touchdown by arms that are not in the landing pose, in S [m]
    arms_shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    landing_speed: float | None = None  # over ground, to stop at landing [m/s]; None: estimated from the distance
    folding_time: float = 0.0  # that the legs take at least to end the take-off's motion and fold [s]

    @property
    def take_off_time(self) -> float:
        """When the last contact ends [s]."""
        return self.dt * len(self.contact)

    @property
    def landing_orientation(self) -> np.ndarray:
        """Attitude ``(4,)`` at touchdown, with the sign a continuous path from no rotation arrives at."""
        return rotation.exp(self.rotation)

    @property
    def aim(self) -> np.ndarray:
        """Attitude ``(4,)`` given to the optimizer as goal: the landing's, corrected by what its coarse flight misses."""
        return rotation.multiply(self.landing_orientation, rotation.exp(self.correction))

    @property
    def landing_yaw(self) -> float:
        """Heading at touchdown in S [rad]."""
        return float(self.rotation[2])


def flight_time(rise: float, height: float) -> float:
    """Return the time [s] of a ballistic flight that rises ``rise`` [m] and ends ``height`` [m] above its start."""
    return float(np.sqrt(2 * rise / GRAVITY) + np.sqrt(2 * (rise - height) / GRAVITY))


def contact_schedule(
    request: MotionRequest,
    motion: Motion,
    robot: Robot,
    dt: float,
    flight_knots: int,
    least_rise: float = 0.0,
    sequence: ContactSequence | None = None,
) -> Schedule:
    """Return the schedule of a request.

    Args:
        request: motion and goal.
        motion: what its YAML says.
        robot: whose contact points are scheduled.
        dt: of the take-off knots [s].
        flight_knots: intervals of the flight.
        least_rise: that the centre of mass must rise above its height over the ground it starts from, where the
            motion's own rule asks for less [m].
        sequence: contacts and footholds of the take-off, in S; None: the motion's contacts, each point where it is.

    Raises:
        RefusalError: if the request sets something the motion does not have.
    """
    _check_goal(request, motion)
    rule = motion.rotation
    turns = 0.0 if rule is None else rule.turns if request.rotation is None else request.rotation
    displacement = request.displacement if np.any(request.displacement) else motion.usual_displacement(turns)
    distance = float(np.linalg.norm(displacement[:2]))
    height = float(displacement[2])
    rise = max(height, 0.0) + motion.flight.clearance + motion.flight.clearance_per_distance * distance
    shortest = flight_time(max(least_rise, rise - _CLEARANCE_SPARED * motion.flight.clearance), height)
    nominal = max(shortest, flight_time(rise, height))
    turn = np.array([0.0, 0.0, request.yaw])
    if rule is not None:
        turn = turn + 2 * np.pi * turns * rule.axis
    take_off = _motion_contacts(motion, robot, turns, dt) if sequence is None else _sequence_contacts(sequence, dt)
    return Schedule(
        **take_off._asdict(),
        flight_time=nominal,
        flight_time_range=(shortest, _FLIGHT_TIME_STRETCH * nominal),
        flight_knots=flight_knots,
        landing_centre=np.array(displacement),
        rotation=turn,
        rotation_at_lift_off=0.0 if rule is None else rule.at_lift_off,
    )


class _Contacts(NamedTuple):
    """The part of a schedule that comes from the take-off's contact phases."""

    dt: float
    contact: np.ndarray
    phase: np.ndarray
    stretch_range: np.ndarray
    foothold: np.ndarray | None


def _motion_contacts(motion: Motion, robot: Robot, turns: float, dt: float) -> _Contacts:
    """Return the contacts that a motion's YAML gives for a turn by ``turns``."""
    masks = np.array([_contacts(phase.contacts, robot, turns) for phase in motion.take_off])
    knots = [max(1, round(phase.duration / dt)) for phase in motion.take_off]
    ranges = [phase.duration_range or (n * dt, n * dt) for phase, n in zip(motion.take_off, knots, strict=True)]
    return _Contacts(
        dt=dt,
        contact=np.repeat(masks, knots, axis=0),
        phase=np.repeat(np.arange(len(knots)), knots),
        stretch_range=np.repeat(np.array(ranges) / (dt * np.array(knots)[:, None]), knots, axis=0),
        foothold=None,
    )


def _sequence_contacts(sequence: ContactSequence, dt: float) -> _Contacts:
    """Return the contacts of a sequence; time steps are near ``dt`` [s], and as long as the whole takes exactly its time.

    Phases begin at knots: one whose duration is no multiple of the step begins up to half a step early or late.
    """
    knots = [max(1, round(phase.duration / dt)) for phase in sequence.phases]
    return _Contacts(
        dt=sequence.duration / sum(knots),
        contact=np.repeat(np.array([phase.contact for phase in sequence.phases], dtype=bool), knots, axis=0),
        phase=np.repeat(np.arange(len(knots)), knots),
        stretch_range=np.ones((sum(knots), 2)),
        foothold=np.repeat(np.array([phase.foothold for phase in sequence.phases]), knots, axis=0),
    )


def contact_bits(contacts: tuple[bool, ...] | None) -> str:
    """Return a contact set as part of a name; None is the knot at which the motion starts."""
    return "start" if contacts is None else "".join("01"[on] for on in contacts)


def _check_goal(request: MotionRequest, motion: Motion) -> None:
    asked = {
        "displacement": bool(np.any(request.displacement)),
        "yaw": request.yaw != 0.0,
        "rotation": request.rotation is not None,
    }
    for name, is_set in asked.items():
        if is_set and name not in motion.goal:
            raise RefusalError(
                RefusalCode.INVALID_REQUEST,
                f"motion '{request.motion}' has no {name} to set; it has: {', '.join(motion.goal) or 'none'}",
            )


def _contacts(entry: Any, robot: Robot, turns: float) -> np.ndarray:
    """Return the mask ``(n_c,)`` of a phase's contacts; an entry may differ with the sense of the turn."""
    names = [point.name for point in robot.contact_points]
    if isinstance(entry, dict):
        entry = entry["positive" if turns >= 0 else "negative"]
    if entry == "all":
        return np.ones(len(names), dtype=bool)
    if isinstance(entry, str) and entry in _SIDES:
        axis, sign = _SIDES[entry]
        points = robot.contact_positions(robot.standing_configuration())  # their centre is the origin
        return sign * points[:, axis] > 0
    if not isinstance(entry, (list, tuple)) or any(name not in names for name in entry):
        raise ConfigurationError(
            f"contacts of a take-off phase: expected 'all', one of {', '.join(_SIDES)}, or some of {names}, found {entry!r}"
        )
    return np.array([name in entry for name in names])
