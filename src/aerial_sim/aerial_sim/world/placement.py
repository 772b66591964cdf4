"""Where the terrain of a selection comes to stand in a world that already has a robot in it."""

from __future__ import annotations

import numpy as np

from aerial_model.robot.robot import Robot
from aerial_model.values.frame import StartFrame
from aerial_model.values.terrain import Box, Terrain

FOOTING = 0.02  # a foot this close to the height of a box stands on it [m]


def placed_ahead(robot: Robot, q: np.ndarray, present: Terrain, selected: Terrain) -> Terrain:
    """Return the terrain in W after a selection.

    The boxes the robot stands on stay, all others go, and the selected ones come, each built up from the floor.
    Selected boxes that do not rise above the start are the ground the robot stands on already: they are left out.
    A terrain that falls away below the start (a step down, a gap) says itself what the robot stands on: it replaces all.

    Args:
        robot: that stands there.
        q: its configuration ``(nq,)`` in W.
        present: terrain in W.
        selected: terrain in the robot's start heading frame.
    """
    feet = robot.contact_positions(q)
    soles = feet[:, 2] - [point.radius for point in robot.contact_points]
    kept = [box for box in present.boxes if np.any(box.covers(feet) & (np.abs(soles - box.top) < FOOTING))]
    frame = StartFrame.of(robot, q).on_floor(float(present.height(feet).max()))
    if selected.floor < -FOOTING:
        return selected.placed(frame)
    new = [box.placed(frame) for box in selected.boxes if box.top > FOOTING]
    return Terrain(boxes=(*kept, *(_from_floor(box, present.floor) for box in new)), base=present.floor)


def _from_floor(box: Box, floor: float) -> Box:
    """Return a box with the same upper face that stands on the floor."""
    centre = np.array([*box.centre[:2], (box.top + floor) / 2])
    return Box(centre=centre, size=np.array([*box.size[:2], box.top - floor]), yaw=box.yaw)
