"""What an operator asks for: a motion, its goal and the terrain it happens on."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from aerial_model.config import frozen_array
from aerial_model.errors import ConfigurationError
from aerial_model.numerics import rotation
from aerial_model.robot.robot import Robot
from aerial_model.values.terrain import GAP_DEPTH, HURDLE_THICKNESS, PLATFORM_LENGTH, Terrain

# Of feet that land on a platform or a gap's bank, from its edge [m]: more than the least, for landings off the goal.
UPPER_MARGIN = 0.08
LOWER_MARGIN = 0.03  # of feet below an edge, or standing on it, from it [m]


class ControllerCommand(StrEnum):
    """Selections that the controller carries out by itself: they need no plan."""

    STAND = "stand"
    LIE_DOWN = "lie_down"
    STAND_UP = "stand_up"
    ABORT = "abort"


@dataclass(frozen=True, kw_only=True)
class MotionRequest:
    """A motion selection.

    Frame: the start heading frame, origin at the centre of the support on the ground, x along the heading, z up.
    """

    motion: str
    displacement: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) of the support centre [m]
    yaw: float = 0.0  # change of heading at landing [rad]
    rotation: float | None = None  # signed turns about the motion's own axis; None: as the motion says
    terrain: Terrain = field(default_factory=Terrain)
    variant: str = "AAKD*"
    warm_start: bool = True
    optimize_timing: bool = False  # of the take-off's phases, within what the motion permits
    request_id: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "displacement", frozen_array(self.displacement, "displacement", (3,)))
        if not np.isfinite(self.yaw) or not np.isfinite(self.rotation or 0.0):
            raise ValueError("yaw and rotation must be finite numbers")

    @property
    def direction(self) -> float:
        """Angle of the jump from x [rad]; forward for a jump on the spot."""
        return float(np.arctan2(self.displacement[1], self.displacement[0]))

    def with_platform(self, robot: Robot, height: float | None = None, edge: float | None = None) -> MotionRequest:
        """Return this request with a platform along the jump.

        Args:
            robot: whose feet must fit.
            height: of the platform above the start [m], negative for a step down; None: the goal's.
            edge: distance to the edge to jump over [m]; None: where the feet fit best.

        Raises:
            ConfigurationError: if the height is 0 or not finite.
        """
        height = float(self.displacement[2]) if height is None else height
        if height == 0 or not np.isfinite(height):
            raise ConfigurationError(f"platform: expected a height other than 0, found {height}")
        if edge is None:
            edge = self._platform_edge(robot, down=height < 0)
        return self._on(Terrain.platform(height, edge, self.direction))

    def with_hurdle(self, robot: Robot, height: float, edge: float | None = None) -> MotionRequest:
        """Return this request with a thin bar across the jump.

        Args:
            robot: whose feet must fit.
            height: of the bar [m].
            edge: distance to its near face [m]; None: midway between standing and landing feet.

        Raises:
            ConfigurationError: if the height is not a positive number.
        """
        if not 0 < height < np.inf:
            raise ConfigurationError(f"hurdle: expected a positive height, found {height}")
        if edge is None:
            edge = float(np.mean([self._standing_feet(robot)[1], self._landing_feet(robot)[0]])) - HURDLE_THICKNESS / 2
        return self._on(Terrain.hurdle(height, edge, self.direction))

    def with_gap(self, robot: Robot, width: float, edge: float | None = None) -> MotionRequest:
        """Return this request with a trench across the jump; its far bank is as high as the goal.

        Args:
            robot: whose feet must fit.
            width: of the trench [m].
            edge: distance to it [m]; None: midway between standing and landing feet, but not under the standing ones.

        Raises:
            ConfigurationError: if the width is not a positive number, or the far bank would lie below the gap's bottom.
        """
        height = float(self.displacement[2])
        if not 0 < width < np.inf:
            raise ConfigurationError(f"gap: expected a positive width, found {width}")
        if height <= -GAP_DEPTH:
            raise ConfigurationError(f"gap: it is {GAP_DEPTH} m deep, a landing {height} m high would lie below it")
        if edge is None:
            front = self._standing_feet(robot)[1]
            middle = (front + self._landing_feet(robot)[0]) / 2
            edge = max(middle - width / 2, front + UPPER_MARGIN)
        return self._on(Terrain.gap(width, edge, self.direction, height))

    def _on(self, terrain: Terrain) -> MotionRequest:
        boxes = self.terrain.boxes + terrain.boxes
        return dataclasses.replace(self, terrain=Terrain(boxes=boxes))

    def _platform_edge(self, robot: Robot, *, down: bool) -> float:
        """Return the distance [m] of the edge to jump over.

        Feet that land on the platform keep ``UPPER_MARGIN``, the others at least ``LOWER_MARGIN``; where both cannot be,
        the edge is halfway between. Flying feet clear an edge the more easily the nearer it is to the upper feet.
        """
        rear_standing, front_standing = self._standing_feet(robot)
        rear_landing, front_landing = self._landing_feet(robot)
        if down:
            nearest, farthest = front_standing + LOWER_MARGIN, rear_landing - LOWER_MARGIN
            edge = nearest if nearest <= farthest else (nearest + farthest) / 2
            return min(edge, rear_standing - LOWER_MARGIN + PLATFORM_LENGTH)
        nearest, farthest = front_standing + LOWER_MARGIN, rear_landing - UPPER_MARGIN
        edge = farthest if nearest <= farthest else (nearest + farthest) / 2
        return max(edge, front_landing + UPPER_MARGIN - PLATFORM_LENGTH)

    def _standing_feet(self, robot: Robot) -> tuple[float, float]:
        return self._extent(robot.contact_positions(robot.standing_configuration()))

    def _landing_feet(self, robot: Robot) -> tuple[float, float]:
        feet = robot.contact_positions(robot.standing_configuration("landing"))
        return self._extent(self.displacement + feet @ rotation.matrix(rotation.about_z(self.yaw)).T)

    def _extent(self, feet: np.ndarray) -> tuple[float, float]:
        """Return the least and the greatest coordinate of points ``(n, 3)`` along the jump [m]."""
        along = feet[:, :2] @ np.array([np.cos(self.direction), np.sin(self.direction)])
        return float(along.min()), float(along.max())
