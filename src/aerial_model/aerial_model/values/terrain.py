"""The ground: a flat floor plus boxes (platforms, hurdles, steps, the banks of a gap), all in one frame.

The floor lies at the terrain's base, or at the lowest box bottom where that is below: a start on top of a platform is a
box whose upper face is at 0, so that the floor around it is a step down; a gap is what two such boxes leave between them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from aerial_model.config import frozen_array
from aerial_model.values.frame import StartFrame

PLATFORM_LENGTH = 0.9  # [m] along the jump: a stance and room to land off the goal
PLATFORM_WIDTH = 0.9  # [m]
HURDLE_THICKNESS = 0.03  # [m]
HURDLE_WIDTH = 0.9  # [m]
BANK_LENGTH = 1.5  # of the ground on either side of a gap, along the jump [m]
BANK_WIDTH = 0.9  # [m]
BOXES_MAX = 64  # of a terrain: more, and a simulator cannot keep the robot's pace
BOX_SIDE_MIN, BOX_SIDE_MAX = 1e-3, 100.0  # of a box [m]: what a foot can feel, and what a robot can cross
DISTANCE_MAX = 1000.0  # of a box's centre or a floor from the origin, along each axis [m]
YAW_MAX = 100.0  # either way: more has lost its digits [rad]
GAP_DEPTH = 0.3  # [m] about the height a robot here stands at: who falls in has not landed


@dataclass(frozen=True, kw_only=True)
class Box:
    """A box standing on (or sunk into) the ground, turned by ``yaw`` about z."""

    centre: np.ndarray  # (3,) [m]
    size: np.ndarray  # (3,) full side lengths [m]
    yaw: float = 0.0  # [rad]

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", frozen_array(self.centre, "box centre", (3,)))
        object.__setattr__(self, "size", frozen_array(self.size, "box size", (3,)))
        if not (self.size.min() >= BOX_SIDE_MIN and self.size.max() <= BOX_SIDE_MAX):
            raise ValueError(
                f"box size: expected positive side lengths from {BOX_SIDE_MIN} to {BOX_SIDE_MAX:.0f} m, found {self.size}"
            )
        if np.abs(self.centre).max() > DISTANCE_MAX:
            raise ValueError(f"box centre: expected at most {DISTANCE_MAX:.0f} m along each axis, found {self.centre}")
        if not abs(self.yaw) <= YAW_MAX:
            raise ValueError(f"box yaw: expected a finite angle of at most {YAW_MAX:.0f} rad, found {self.yaw}")

    @property
    def top(self) -> float:
        """Height of the upper face [m]."""
        return float(self.centre[2] + self.size[2] / 2)

    def covers(self, points: np.ndarray, margin: float = 0.0) -> np.ndarray:
        """Return for points ``(..., 2+)`` [m] whether they lie over the box, grown by ``margin`` [m] to all sides."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        offset = np.asarray(points)[..., :2] - self.centre[:2]
        local = np.stack([c * offset[..., 0] + s * offset[..., 1], -s * offset[..., 0] + c * offset[..., 1]], axis=-1)
        return np.all(np.abs(local) <= self.size[:2] / 2 + margin, axis=-1)

    def placed(self, frame: StartFrame) -> Box:
        """Return this box, given in a start heading frame, in the frame in which that one lies as ``frame`` says."""
        return Box(centre=frame.origin + frame.R_WS @ self.centre, size=self.size, yaw=self.yaw + frame.heading)


@dataclass(frozen=True, kw_only=True)
class Terrain:
    """A flat floor and boxes on it, in the start heading frame unless said otherwise."""

    boxes: tuple[Box, ...] = field(default_factory=tuple)
    base: float = 0.0  # height of the floor, unless a box reaches deeper [m]

    def __post_init__(self) -> None:
        if len(self.boxes) > BOXES_MAX:
            raise ValueError(f"boxes: expected at most {BOXES_MAX}, found {len(self.boxes)}")
        if not abs(self.base) <= DISTANCE_MAX:
            raise ValueError(f"base: expected a finite height of at most {DISTANCE_MAX:.0f} m, found {self.base}")

    @staticmethod
    def platform(height: float, edge: float, direction: float) -> Terrain:
        """Return a platform to jump onto, or, with a negative ``height`` [m], one to jump off.

        Args:
            height: of the landing above the start [m], not 0.
            edge: distance from the origin, along the jump, to the near edge of the platform jumped onto or to the far
                edge of the one jumped off [m].
            direction: of the jump, angle from x [rad].
        """
        middle = edge + PLATFORM_LENGTH / 2 if height > 0 else edge - PLATFORM_LENGTH / 2
        centre = np.array([middle * np.cos(direction), middle * np.sin(direction), height / 2])
        return Terrain(
            boxes=(Box(centre=centre, size=np.array([PLATFORM_LENGTH, PLATFORM_WIDTH, abs(height)]), yaw=direction),)
        )

    @staticmethod
    def hurdle(height: float, edge: float, direction: float) -> Terrain:
        """Return a thin bar on the ground, across the jump.

        Args:
            height: of the bar [m].
            edge: distance from the origin, along the jump, to the bar's near face [m].
            direction: of the jump, angle from x [rad].
        """
        middle = edge + HURDLE_THICKNESS / 2
        centre = np.array([middle * np.cos(direction), middle * np.sin(direction), height / 2])
        return Terrain(
            boxes=(Box(centre=centre, size=np.array([HURDLE_THICKNESS, HURDLE_WIDTH, height]), yaw=direction),)
        )

    @staticmethod
    def gap(width: float, edge: float, direction: float, height: float = 0.0) -> Terrain:
        """Return a trench across the jump, between the ground jumped from and that jumped onto.

        Args:
            width: of the trench, along the jump [m].
            edge: distance from the origin, along the jump, to the trench [m].
            direction: of the jump, angle from x [rad].
            height: of the far bank above the near one [m].
        """
        near = _bank(edge - BANK_LENGTH / 2, 0.0, direction)
        return Terrain(boxes=(near, _bank(edge + width + BANK_LENGTH / 2, height, direction)))

    @property
    def floor(self) -> float:
        """Height of the flat floor [m]."""
        return min([self.base, *(float(box.centre[2] - box.size[2] / 2) for box in self.boxes)])

    def height(self, points: np.ndarray, margin: float = 0.0) -> np.ndarray:
        """Return the height [m] of the ground under points ``(..., 2+)`` [m], boxes grown by ``margin`` [m]."""
        points = np.asarray(points)
        ground = np.full(points.shape[:-1], self.floor)
        for box in self.boxes:
            ground = np.where(box.covers(points, margin), np.maximum(ground, box.top), ground)
        return ground

    def placed(self, frame: StartFrame) -> Terrain:
        """Return the terrain, given in a start heading frame, in the frame in which that one lies as ``frame`` says."""
        boxes = tuple(box.placed(frame) for box in self.boxes)
        return Terrain(boxes=boxes, base=float(frame.origin[2]) + self.base)


def _bank(middle: float, top: float, direction: float) -> Box:
    """Return a box from the bottom of a gap up to ``top``, its middle at a distance along the jump; all in [m]."""
    size = np.array([BANK_LENGTH, BANK_WIDTH, top + GAP_DEPTH])
    centre = np.array([middle * np.cos(direction), middle * np.sin(direction), (top - GAP_DEPTH) / 2])
    return Box(centre=centre, size=size, yaw=direction)
