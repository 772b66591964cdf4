"""The collision shapes of a URDF: what spans them, and which of them the contact points stand for."""

from __future__ import annotations

import itertools

import coal
import numpy as np
import pinocchio as pin

_NEAR = 0.05  # of the centre of mass's height: a shape that reaches as low at home is what the robot stands on


def spanning_points(shape: pin.GeometryObject) -> np.ndarray:
    """Return points ``(k, 3)`` [m] whose convex hull holds a shape, in the frame of its joint; none for other kinds."""
    geometry = shape.geometry
    if isinstance(geometry, coal.Box):
        half = np.array(geometry.halfSide)
        points = np.array(list(itertools.product(*zip(-half, half, strict=True))))
    elif isinstance(geometry, coal.Sphere):
        points = geometry.radius * np.vstack([np.eye(3), -np.eye(3)])
    elif isinstance(geometry, (coal.Cylinder, coal.Capsule)):
        cap = geometry.radius if isinstance(geometry, coal.Capsule) else 0.0
        r, h = geometry.radius, geometry.halfLength + cap
        points = np.array(list(itertools.product((-r, r), (-r, r), (-h, h))))
    elif isinstance(geometry, coal.BVHModelBase):
        points = np.array([geometry.vertices(k) for k in range(geometry.num_vertices)])
    else:
        return np.zeros((0, 3))
    return points @ shape.placement.rotation.T + shape.placement.translation


def lowest(shape: pin.GeometryObject, joint: pin.SE3) -> float:
    """Return the height [m] of a shape's lowest point, given the placement of its joint."""
    if isinstance(shape.geometry, coal.Sphere):
        return float(joint.act(shape.placement).translation[2] - shape.geometry.radius)
    points = spanning_points(shape)
    return float((points @ joint.rotation.T)[:, 2].min() + joint.translation[2]) if len(points) else np.inf


def standing_shapes(model: pin.Model, shapes: pin.GeometryModel, q: np.ndarray) -> set[str]:
    """Return the names of the shapes that are as good as on the ground, z = 0, when the robot stands at ``q`` ``(nq,)``.

    The contact points stand for them: nothing else of the robot is meant to touch.
    """
    data = model.createData()
    near = _NEAR * pin.centerOfMass(model, data, q)[2]
    return {shape.name for shape in shapes.geometryObjects if lowest(shape, data.oMi[shape.parentJoint]) < near}
