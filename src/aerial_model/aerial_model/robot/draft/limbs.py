"""The limbs a robot stands on and their contact points, guessed: the lowest ends of its kinematic tree."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from aerial_model.errors import ConfigurationError
from aerial_model.robot.draft.mechanism import Mechanism, in_base
from aerial_model.robot.shapes import lowest, spanning_points

RADIUS = 0.004  # of contact spheres: small, so that rolling moves a contact by millimetres [m]
_LOW = 0.15  # of the leg length: ends of limbs within this of the lowest stand on the ground
_SAME = 0.005  # [m] that spheres of one sole may differ in height
_ROUND = 1.5  # greatest over least extent of a ball
_FLATNESS = 1.0  # height of a foot over its length, at most
_FLAT = 0.02  # [m] that the corners of a sole are apart at least
_ZERO = 1e-6  # [m] below which a coordinate is none


@dataclass(frozen=True, kw_only=True)
class Foot:
    """Points that the last link of a limb would stand on, and the radius [m] of the spheres around them."""

    points: tuple[tuple[int, np.ndarray], ...]  # Pinocchio frame and centre of the sphere in it [m]
    radius: float = RADIUS


@dataclass(frozen=True, kw_only=True)
class Limb:
    """A limb that stands on the ground: from the body to the link that carries the contact points."""

    joints: tuple[int, ...]  # Pinocchio joints from the body to that link
    foot: Foot


@dataclass(frozen=True, kw_only=True)
class Legs:
    """All limbs that stand on the ground."""

    limbs: tuple[Limb, ...]
    length: float  # from the base down to the lowest end [m]

    @property
    def is_biped(self) -> bool:
        """Whether there are two."""
        return len(self.limbs) == 2


@dataclass(frozen=True, kw_only=True)
class ContactGuess:
    """A contact point as ``robot.yaml`` has it."""

    name: str
    frame: str  # URDF link
    offset: np.ndarray  # of the sphere's centre in the link (3,) [m]
    radius: float  # [m]


def legs_of(mechanism: Mechanism) -> Legs:
    """Return the limbs whose ends are the lowest with all joints at zero.

    Raises:
        ConfigurationError: if there are not two of them.
    """
    ends = mechanism.ends()
    feet = {j: _foot(mechanism, j) for j in ends}
    heights = {j: min(in_base(mechanism.data, *point)[2] for point in foot.points) for j, foot in feet.items()}
    floor = min(heights.values())
    length = float(-floor) if floor < 0 else 1.0
    standing = [j for j in ends if heights[j] < floor + _LOW * length]
    if len(standing) < 2 and len(ends) > 1:
        raise ConfigurationError(
            f"{mechanism.urdf}: fewer than two limbs reach the ground with all joints at zero: no legs to guess"
        )
    return Legs(limbs=tuple(Limb(joints=mechanism.chain(j), foot=feet[j]) for j in standing), length=length)


def contact_points(mechanism: Mechanism, legs: Legs, home: np.ndarray) -> list[ContactGuess]:
    """Return the contact points; a ball is reduced to a small sphere at its lowest point at ``home`` ``(n,)`` [rad]."""
    model = mechanism.model
    data, q = model.createData(), pin.neutral(model)
    q[7:] = home
    pin.framesForwardKinematics(model, data, q)
    guesses = []
    for foot in (limb.foot for limb in legs.limbs):
        radius = min(RADIUS, foot.radius)
        for k, (frame, centre) in enumerate(foot.points):
            link = str(model.frames[frame].name)
            name = re.sub(r"_?(link|foot|sole)$", "", link) or link
            offset = centre - data.oMf[frame].rotation.T @ [0.0, 0.0, foot.radius - radius]
            offset = np.where(np.abs(offset) < _ZERO, 0.0, offset)
            name = f"{name}_{k + 1}" if len(foot.points) > 1 else name
            guesses.append(ContactGuess(name=name, frame=link, offset=offset, radius=radius))
    return guesses


def _foot(mechanism: Mechanism, joint: int) -> Foot:
    """Return what a limb's last link would stand on: its low spheres, a ball, the corners of a sole, or its lowest frame."""
    model, placement = mechanism.model, mechanism.data.oMi[joint]
    shapes = [shape for shape in mechanism.shapes if shape.parentJoint == joint]
    spheres = [shape for shape in shapes if isinstance(shape.geometry, coal.Sphere)]
    if spheres:
        return _spheres(mechanism, spheres)
    if shapes:
        low = min(shapes, key=lambda shape: lowest(shape, placement))
        cloud = spanning_points(low)
        found = (_ball(mechanism, low, cloud) or _sole(mechanism, low, cloud)) if len(cloud) else None
        if found is not None:
            return found
    frames = [i for i, f in enumerate(model.frames) if f.parentJoint == joint and f.type == pin.FrameType.BODY]
    tip = min(frames, key=lambda i: mechanism.data.oMf[i].translation[2])
    return Foot(points=((tip, np.zeros(3)),))


def _spheres(mechanism: Mechanism, spheres: list[pin.GeometryObject]) -> Foot:
    """Return a foot of the lowest among a link's spheres."""
    centres = [mechanism.data.oMi[s.parentJoint].act(s.placement).translation for s in spheres]
    heights = [centre[2] - s.geometry.radius for s, centre in zip(spheres, centres, strict=True)]
    low = [s for s, z in zip(spheres, heights, strict=True) if z < min(heights) + _SAME]
    points = tuple((s.parentFrame, mechanism.offset_in(s.parentFrame, s.placement.translation)) for s in low)
    return Foot(points=points, radius=float(low[0].geometry.radius))


def _ball(mechanism: Mechanism, shape: pin.GeometryObject, cloud: np.ndarray) -> Foot | None:
    """Return a foot that is as good as a sphere, such as a ball drawn as a mesh; None for what is longer one way."""
    extent = np.ptp(cloud, axis=0)
    if extent.max() >= _ROUND * extent.min():
        return None
    centre = mechanism.offset_in(shape.parentFrame, (cloud.max(axis=0) + cloud.min(axis=0)) / 2)
    return Foot(points=((shape.parentFrame, centre),), radius=float(extent.max() / 2))


def _sole(mechanism: Mechanism, shape: pin.GeometryObject, cloud: np.ndarray) -> Foot | None:
    """Return a foot of the corners of the rectangle on which a shape stands; None for what is hardly a sole."""
    placement = mechanism.data.oMi[shape.parentJoint]
    points = cloud @ placement.rotation.T + placement.translation
    if np.ptp(points[:, 2]) > _FLATNESS * np.ptp(points[:, :2], axis=0).max():
        return None  # a shank, not a foot
    bottom = points[points[:, 2] < points[:, 2].min() + _FLAT]
    low, high = bottom.min(axis=0), bottom.max(axis=0)
    z = points[:, 2].min() + RADIUS
    xs = (high[0], low[0]) if high[0] - low[0] > _FLAT else ((high[0] + low[0]) / 2,)
    ys = (low[1], high[1]) if high[1] - low[1] > _FLAT else ((high[1] + low[1]) / 2,)
    corners = []
    for x, y in itertools.product(xs, ys):
        inner_x = x + RADIUS * np.sign((xs[0] + xs[-1]) / 2 - x)
        inner_y = y + RADIUS * np.sign((ys[0] + ys[-1]) / 2 - y)
        local = placement.rotation.T @ (np.array([inner_x, inner_y, z]) - placement.translation)
        corners.append((shape.parentFrame, mechanism.offset_in(shape.parentFrame, local)))
    return Foot(points=tuple(corners))
