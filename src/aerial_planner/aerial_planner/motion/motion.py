"""Motions as data: what their YAML files say, and where those are.

A motion is one YAML file in ``motions/``; no motion has code of its own. Those of this package hold for any robot: they
name contact points by where they are; their times and lengths, those of a Mini Cheetah, are scaled, and a robot with
weaker legs for its weight flies lower. A robot's folder may have ``motions/`` of its own, which come first and hold as they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from aerial_model.config import closest, from_mapping, load_yaml
from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.robot.scale import Scale, Unit

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
    goal: tuple[str, ...]  # names of the request's numbers that may be set
    rotation: RotationRule | None = None  # a motion that turns
    displacement: np.ndarray = field(default_factory=lambda: np.zeros(3))  # where the request says nothing [m]

    @staticmethod
    def from_mapping(mapping: Mapping[str, Any]) -> Motion:
        """Return a motion given as the mapping that its YAML file would hold; times and lengths are taken as they are.

        Raises:
            ConfigurationError: for a missing or unknown key or a value of the wrong kind.
        """
        return from_mapping(Motion, mapping, "motion")

    def usual_displacement(self, turns: float) -> np.ndarray:
        """Return where to land ``(3,)`` [m] if the request does not say: a turn the other way is the mirror image."""
        if self.rotation is None or turns * self.rotation.turns >= 0:
            return self.displacement
        across = np.cross([0.0, 0.0, 1.0], self.rotation.axis)
        return self.displacement - 2 * (self.displacement @ across) * across


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
