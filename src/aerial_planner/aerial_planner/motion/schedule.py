"""From a request to its contact schedule: which contact point carries load when, how long the flight is, where it ends.

A motion is data: one YAML file in ``motions/``; no motion has code of its own. Those of this package hold for any robot:
they name contact points by where they are; their times and lengths, those of a Mini Cheetah, are scaled, and a robot
with weaker legs for its weight flies lower. A robot's folder may have ``motions/`` of its own, which come first and hold as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from aerial_model.config import closest, from_mapping, load_yaml
from aerial_model.errors import ConfigurationError, RefusalCode, RefusalError
from aerial_model.numerics import rotation
from aerial_model.robot.robot import GRAVITY, Robot
from aerial_model.robot.scale import Scale, Unit
from aerial_model.values.request import MotionRequest

_CLEARANCE_SPARED = 0.6  # share of the clearance the optimizer may do without where it binds
_FLIGHT_TIME_STRETCH = 1.2  # longest flight over the nominal one
_SIDES = {"front": (0, 1), "rear": (0, -1), "left": (1, 1), "right": (1, -1)}  # axis and sign, seen from the centre
_REFERENCE_STRENGTH = 9.0  # of the Mini Cheetah, see ``Robot.strength``
_LEAST_SPRING = 0.25  # share of the clearance that the weakest robot is asked for
_UNITS = {
    "duration": Unit(time=1),
    "duration_range": Unit(time=1),
    "flight.clearance": Unit(length=1),
    "displacement": Unit(length=1),
}


@dataclass(frozen=True, kw_only=True)
class FlightRule:
    """How high a motion flies; see the YAML of ``jump``."""

    clearance: float  # of the centre of mass above its landing height at apex [m]
    clearance_per_distance: float = 0.0  # [m/m]


@dataclass(frozen=True, kw_only=True)
class RotationRule:
    """About what and how far a motion turns."""

    axis: np.ndarray  # (3,) in S
    turns: float  # where the request says nothing
    at_lift_off: float  # share of the turn that the reference has behind it when the last contact ends


@dataclass(frozen=True, kw_only=True)
class Phase:
    """A part of the take-off with the same contacts."""

    contacts: Any  # `all`, a side, names, or a mapping of the sense of the turn (positive, negative) to any of these
    duration: float  # [s]
    duration_range: tuple[float, float] | None = None  # that an optimized duration must stay in [s]; None: fixed

    def __post_init__(self) -> None:
        least, greatest = self.duration_range or (self.duration, self.duration)
        if not 0 < least <= self.duration <= greatest:
            raise ValueError(f"expected 0 < least ≤ duration ≤ greatest, found {least}, {self.duration}, {greatest}")


@dataclass(frozen=True, kw_only=True)
class Motion:
    """One motion as its YAML file says."""

    summary: str
    take_off: tuple[Phase, ...]
    flight: FlightRule
    goal: tuple  # of names of the request's numbers that may be set
    rotation: RotationRule | None = None  # a motion that turns
    displacement: np.ndarray = field(default_factory=lambda: np.zeros(3))  # where the request says nothing [m]

    def usual_displacement(self, turns: float) -> np.ndarray:
        """Return where to land ``(3,)`` [m] if the request does not say: a turn the other way is the mirror image."""
        if self.rotation is None or turns * self.rotation.turns >= 0:
            return self.displacement
        across = np.cross([0.0, 0.0, 1.0], self.rotation.axis)
        return self.displacement - 2 * (self.displacement @ across) * across


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """The discrete skeleton of one plan."""

    dt: float  # of the take-off knots [s]
    contact: np.ndarray  # (N, n_c) bool: contact on [t_k, t_k+1), all of the take-off
    phase: np.ndarray  # (N,) int: which phase of the take-off
    stretch_range: np.ndarray  # (N, 2) least and greatest factor of dt, one for all of a phase, if timing is optimized
    flight_time: float  # that the optimizer should stay near [s]
    flight_time_range: tuple[float, float]  # that it must stay in [s]
    flight_knots: int  # intervals the flight is integrated with
    landing_centre: np.ndarray  # (3,) of the support at landing, in S, z: the surface [m]
    rotation: np.ndarray  # (3,) to accumulate from start to touchdown, as a rotation vector in S [rad]
    rotation_at_lift_off: float = 0.0  # share of it that the reference has behind it at lift-off
    correction: np.ndarray = field(
        default_factory=lambda: np.zeros(3)
    )  # (3,) of what to aim at, in the landed base [rad]
    arms_shift: np.ndarray = field(
        default_factory=lambda: np.zeros(3)
    )  # (3,) of the centre of mass at touchdown by arms that are not in the landing pose, in S [m]
    landing_speed: float | None = None  # over ground that the landing is to stop; None: as guessed from the way [m/s]
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
        """Attitude ``(4,)`` that the optimizer is told: the landing's, corrected by what its coarse flight misses."""
        return rotation.multiply(self.landing_orientation, rotation.exp(self.correction))

    @property
    def landing_yaw(self) -> float:
        """Heading at touchdown in S [rad]."""
        return float(self.rotation[2])


@cache
def motions_folder() -> Path:
    """Return the folder whose YAML files are the motions that any robot has."""
    return Path(str(resources.files("aerial_planner"))) / "motions"


def known_motions(robot: Robot) -> dict[str, Path]:
    """Return the motions a robot has: name → file."""
    return {path.stem: path for folder in _folders(robot) for path in sorted(folder.glob("*.yaml"))}


def _folders(robot: Robot) -> list[Path]:
    """Return where a robot's motions are; of two of a name the later counts."""
    return [motions_folder(), *(folder / "motions" for folder in reversed(robot.folders))]


def _is_there(file: Path) -> bool:
    try:
        return file.is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False


def load_motion(name: str, robot: Robot) -> Motion:
    """Return a motion of a robot by name.

    Raises:
        RefusalError: if there is none of that name, with the names that exist.
    """
    files = [folder / f"{name}.yaml" for folder in reversed(_folders(robot))]
    file = next((file for file in files if file.stem == name and _is_there(file)), None)
    if file is None:
        known = known_motions(robot)
        raise RefusalError(
            RefusalCode.UNKNOWN_MOTION, f"unknown motion '{name}'{closest(name, known)}; known: {', '.join(known)}"
        )
    changed = file.stat().st_mtime_ns
    if file.parent != motions_folder():
        return _read_motion(file, changed, Scale(), 1.0)
    # What is left of the legs' force when the weight is borne is what the robot rises by.
    spring = float(np.clip((robot.strength - 1) / (_REFERENCE_STRENGTH - 1), _LEAST_SPRING, 1.0))
    return _read_motion(file, changed, robot.scale, spring)


@lru_cache
def _read_motion(file: Path, changed: int, scale: Scale, spring: float) -> Motion:
    motion = from_mapping(Motion, scale.applied(load_yaml(file), _UNITS), str(file))
    return replace(motion, flight=replace(motion.flight, clearance=spring * motion.flight.clearance))


def flight_time(rise: float, height: float) -> float:
    """Return the time [s] of a ballistic flight that rises ``rise`` [m] and ends ``height`` [m] above its start."""
    return float(np.sqrt(2 * rise / GRAVITY) + np.sqrt(2 * (rise - height) / GRAVITY))


def contact_schedule(
    request: MotionRequest, motion: Motion, robot: Robot, dt: float, flight_knots: int, least_rise: float = 0.0
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

    Raises:
        RefusalError: if the request sets something the motion does not have.
    """
    _check_goal(request, motion)
    rule = motion.rotation
    turns = 0.0 if rule is None else rule.turns if request.rotation is None else request.rotation
    masks = np.array([_contacts(phase.contacts, robot, turns) for phase in motion.take_off])
    knots = [max(1, round(phase.duration / dt)) for phase in motion.take_off]
    ranges = [phase.duration_range or (n * dt, n * dt) for phase, n in zip(motion.take_off, knots, strict=True)]
    displacement = request.displacement if np.any(request.displacement) else motion.usual_displacement(turns)
    distance = float(np.linalg.norm(displacement[:2]))
    height = float(displacement[2])
    rise = max(height, 0.0) + motion.flight.clearance + motion.flight.clearance_per_distance * distance
    shortest = flight_time(max(least_rise, rise - _CLEARANCE_SPARED * motion.flight.clearance), height)
    nominal = max(shortest, flight_time(rise, height))
    turn = np.array([0.0, 0.0, request.yaw])
    if rule is not None:
        turn = turn + 2 * np.pi * turns * rule.axis
    return Schedule(
        dt=dt,
        contact=np.repeat(masks, knots, axis=0),
        phase=np.repeat(np.arange(len(knots)), knots),
        stretch_range=np.repeat(np.array(ranges) / (dt * np.array(knots)[:, None]), knots, axis=0),
        flight_time=nominal,
        flight_time_range=(shortest, _FLIGHT_TIME_STRETCH * nominal),
        flight_knots=flight_knots,
        landing_centre=np.array(displacement),
        rotation=turn,
        rotation_at_lift_off=0.0 if rule is None else rule.at_lift_off,
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
