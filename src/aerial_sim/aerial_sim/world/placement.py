"""Where the terrain of a request comes to lie in a world that already has a robot in it: the one rule for everybody."""

from __future__ import annotations

import numpy as np

from aerial_model.robot.robot import Robot
from aerial_model.values.frame import StartFrame
from aerial_model.values.terrain import Box, Terrain

FOOTING = 0.02  # a foot this close to the height of a box stands on it [m]
GROUND_SHIFT_MAX = 0.005  # by which terrain that is replaced may move the ground under a standing foot [m]


def placed(robot: Robot, q: np.ndarray, present: Terrain, requested: Terrain) -> Terrain:
    """Return the terrain in W once a request's terrain has been placed around the robot as it stands.

    The boxes the robot stands on stay, all others go, and the requested ones come, each built up from the floor.
    Requested boxes that do not rise above the start are the ground the robot stands on already: they are left out.
    A terrain that falls away below the start (a step down, a gap) says itself what the robot stands on: it replaces all,
    and the floor sinks as deep as it says.

    Args:
        robot: that stands there.
        q: its configuration ``(nq,)`` in W.
        present: terrain in W.
        requested: terrain in the robot's start heading frame.
    """
    feet = robot.contact_positions(q)
    kept = [
        box for box in present.boxes if np.any(box.covers(feet) & (np.abs(_soles(robot, feet) - box.top) < FOOTING))
    ]
    frame = StartFrame.of(robot, q).on_floor(float(present.height(feet).max()))
    if requested.floor < -FOOTING:
        return requested.placed(frame)
    new = [box.placed(frame) for box in requested.boxes if box.top > FOOTING]
    return Terrain(boxes=(*kept, *(_from_floor(box, present.floor) for box in new)), base=present.floor)


def ground_shift(robot: Robot, q: np.ndarray, present: Terrain, new: Terrain) -> float:
    """Return by how much the ground would rise (or, negative, sink) under the feet that stand on it, the most [m].

    Args:
        robot: that stands there.
        q: its configuration ``(nq,)`` in W.
        present: terrain in W.
        new: terrain in W that would replace it.
    """
    feet = robot.contact_positions(q)
    before = present.height(feet)
    shift = np.where(np.abs(_soles(robot, feet) - before) < FOOTING, new.height(feet) - before, 0.0)
    return float(shift[np.argmax(np.abs(shift))])


def _soles(robot: Robot, feet: np.ndarray) -> np.ndarray:
    """Return the heights ``(n_c,)`` of the lowest points of contact points at ``feet`` ``(n_c, 3)``, all in W [m]."""
    return feet[:, 2] - [point.radius for point in robot.contact_points]


def _from_floor(box: Box, floor: float) -> Box:
    """Return a box with the same upper face that stands on the floor."""
    centre = np.array([*box.centre[:2], (box.top + floor) / 2])
    return Box(centre=centre, size=np.array([*box.size[:2], box.top - floor]), yaw=box.yaw)
