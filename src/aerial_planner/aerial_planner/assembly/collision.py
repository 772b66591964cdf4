"""The first touch of a link with the terrain or another link along a plan, checked after the optimization, as in the thesis.

The shapes are the URDF's collision geometry, by coal through Pinocchio. Contact points and the shapes they stand for are
left out: they are meant to touch, and their clearance is a number of its own (see ``checks``).
"""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from aerial_model.numerics import rotation
from aerial_model.robot.robot import Robot
from aerial_model.robot.shapes import standing_shapes
from aerial_model.values.plan import Plan
from aerial_model.values.terrain import Terrain

TERRAIN_MARGIN = 0.001  # that links keep from the terrain [m]; a deep crouch brings shanks within millimetres
_FLOOR = np.array([40.0, 40.0, 1.0])  # the box that stands for the flat floor [m]
_GROUND = "terrain"


@dataclass(frozen=True, kw_only=True)
class Touch:
    """Two bodies that meet."""

    time: float  # [s]
    link: str
    other: str  # a link, or ``terrain``

    @property
    def is_terrain(self) -> bool:
        """Whether the ground is one of the two."""
        return self.other == _GROUND

    def __str__(self) -> str:
        return f"{self.link} would touch {'the ' if self.is_terrain else ''}{self.other} at {self.time:.2f} s"


class CollisionModel:
    """The collision geometry of a robot; links that meet in the home pose or share a joint are never a pair."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._geometry = pin.buildGeomFromUrdfString(robot.model, robot.description.text, pin.GeometryType.COLLISION)
        self._self_pairs = self._pairs()
        standing = standing_shapes(robot.model, self._geometry, robot.standing_configuration())
        self._above_ground = [k for k, item in enumerate(self._geometry.geometryObjects) if item.name not in standing]

    def first_touch(self, plan: Plan) -> Touch | None:
        """Return the first touch along a plan, None if nothing touches."""
        geometry = self._with(plan.terrain)
        data, results = self.robot.model.createData(), pin.GeometryData(geometry)
        for request, pair in zip(results.collisionRequests, geometry.collisionPairs, strict=True):
            ground = geometry.geometryObjects[pair.second].name == _GROUND
            request.security_margin = TERRAIN_MARGIN if ground else 0.0
        for time, q in zip(plan.time, plan.q, strict=True):
            if pin.computeCollisions(self.robot.model, data, geometry, results, q, False):
                hit = next(i for i, result in enumerate(results.collisionResults) if result.isCollision())
                pair = geometry.collisionPairs[hit]
                link, other = self._link(geometry, pair.first), self._link(geometry, pair.second)
                return Touch(time=float(time), link=link, other=other)
        return None

    def _link(self, geometry: pin.GeometryModel, index: int) -> str:
        item = geometry.geometryObjects[index]
        return _GROUND if item.name == _GROUND else self.robot.model.frames[item.parentFrame].name

    def _pairs(self) -> list[pin.CollisionPair]:
        model, geometry = self.robot.model, self._geometry
        home = self.robot.standing_configuration()
        pairs = [
            pin.CollisionPair(a, b)
            for b, second in enumerate(geometry.geometryObjects)
            for a, first in enumerate(geometry.geometryObjects[:b])
            if not self._share_a_joint(first.parentJoint, second.parentJoint)
        ]
        trial = geometry.copy()
        for pair in pairs:
            trial.addCollisionPair(pair)
        results = pin.GeometryData(trial)
        pin.computeCollisions(model, model.createData(), trial, results, home, False)
        return [pair for pair, result in zip(pairs, results.collisionResults, strict=True) if not result.isCollision()]

    def _share_a_joint(self, a: int, b: int) -> bool:
        parents = self.robot.model.parents
        return a == b or parents[a] == b or parents[b] == a

    def _with(self, terrain: Terrain) -> pin.GeometryModel:
        """Return the robot's geometry and the terrain's, with all pairs that count."""
        geometry = self._geometry.copy()
        floor = np.array([0.0, 0.0, terrain.floor - _FLOOR[2] / 2])
        boxes = [(floor, _FLOOR, 0.0), *((box.centre, box.size, box.yaw) for box in terrain.boxes)]
        for pair in self._self_pairs:
            geometry.addCollisionPair(pair)
        for centre, size, yaw in boxes:
            placement = pin.SE3(rotation.matrix(rotation.about_z(yaw)), np.array(centre))
            index = geometry.addGeometryObject(pin.GeometryObject(_GROUND, 0, placement, coal.Box(*size)))
            for link in self._above_ground:
                geometry.addCollisionPair(pin.CollisionPair(link, index))
        return geometry
