"""How large a robot is, and what follows for numbers that were found on another: dimensional analysis.

Two robots of the same build that differ in size move alike when times go with √(h/g): Froude's similarity. So a number
that was found on the reference robot (the Mini Cheetah) holds for another when it is multiplied by the ratios of mass,
length and time to the powers of its unit. Angles, shares and counts stay.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

REFERENCE_MASS = 8.912  # of the Mini Cheetah [kg]
REFERENCE_HEIGHT = 0.2761  # of its centre of mass above the ground in the home pose [m]


class Unit(NamedTuple):
    """Exponents of mass, length and time."""

    mass: float = 0.0
    length: float = 0.0
    time: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Ratios of a robot's mass and height to the reference robot's."""

    mass: float = 1.0
    length: float = 1.0

    @property
    def time(self) -> float:
        """Ratio of the times that similar motions take."""
        return self.length**0.5

    def factor(self, unit: Unit) -> float:
        """Return by what a number of that unit is multiplied."""
        return self.mass**unit.mass * self.length**unit.length * self.time**unit.time

    def applied(self, mapping: Mapping[str, Any], units: Mapping[str, Unit]) -> dict[str, Any]:
        """Return a nested mapping with every number scaled.

        Args:
            mapping: of names to numbers, lists of numbers, mappings, lists of those, or anything else, which stays.
            units: of the numbers that have one: dotted path, or its tail, → unit; the longest that fits counts.
        """
        return {key: self._applied(value, units, (key,)) for key, value in mapping.items()}

    def _applied(self, value: Any, units: Mapping[str, Unit], path: tuple[str, ...]) -> Any:
        if isinstance(value, Mapping):
            return {key: self._applied(item, units, (*path, key)) for key, item in value.items()}
        if isinstance(value, (list, tuple)) and any(isinstance(item, Mapping) for item in value):
            return [self._applied(item, units, path) for item in value]
        tails = (".".join(path[i:]) for i in range(len(path)))
        unit = next((units[tail] for tail in tails if tail in units), None)
        if unit is None or isinstance(value, (str, bool)):
            return value
        if isinstance(value, (list, tuple)):
            return [self.factor(unit) * item for item in value]
        return self.factor(unit) * value
