"""Pictures without a display, a graphics card or an OpenGL library: MuJoCo's ray queries, shaded here.

Light comes from a sun with soft shadows and from an even sky, both sampled by point lights far away. A pixel averages
several rays, and each of them asks a different share of the lights: smooth shadows for the price of a few.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from aerial_sim.picture.still_life import FLOOR, StillLife

FAR = 100.0  # [m] nothing is drawn beyond
LIGHT_DISTANCE = 40.0  # [m]
SHADOW_BIAS = 5e-4  # [m] a surface does not shade itself
SUN_DIRECTION = np.array([-0.45, 1.0, -0.6])  # towards it: to the camera's right, up, and away from the camera
SUN_RADIUS = 0.07  # over its distance: how soft its shadows are
SUN_SAMPLES = 8
SKY_SAMPLES = 16
SUN_SHARE = 0.55  # of the light on the floor
BACKGROUND = np.array([0.94, 0.945, 0.955])  # of sky and far floor, linear light
FADE = (1.5, 5.0)  # distance from the middle of the picture at which the floor begins and ends to fade [m]
GRID = ((0.1, 0.002, 0.12), (0.5, 0.004, 0.3))  # pitch [m], half width [m] and darkness of the floor's lines
GAMMA = 2.2
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))  # samples spaced by it fill a disc or a dome evenly [rad]


@dataclass(frozen=True, kw_only=True)
class Camera:
    """A pinhole camera that keeps the vertical vertical."""

    position: np.ndarray  # (3,) in W [m]
    target: np.ndarray  # (3,) what is in the middle of the picture, in W [m]
    field_of_view: float  # vertical, whole angle [rad]

    @property
    def axes(self) -> np.ndarray:
        """Right, up and forward as rows ``(3, 3)``, in W."""
        forward = self.target - self.position
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right = right / np.linalg.norm(right)
        return np.array([right, np.cross(right, forward), forward])

    def rays(self, width: int, height: int, offset: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
        """Return unit directions ``(height·width, 3)`` in W through the pixels, rows from the top.

        Args:
            width: of the picture [pixel].
            height: of the picture [pixel].
            offset: of the rays from the pixels' centres, right and down [pixel].
        """
        scale = 2 * np.tan(self.field_of_view / 2) / height  # [1/pixel]
        right = scale * (np.arange(width) + 0.5 + offset[0] - width / 2)
        down = scale * (np.arange(height) + 0.5 + offset[1] - height / 2)
        r, d = np.meshgrid(right, down)
        directions = np.stack([r, -d, np.ones_like(r)], axis=-1).reshape(-1, 3) @ self.axes
        return directions / np.linalg.norm(directions, axis=1, keepdims=True)

    def project(self, points: np.ndarray, width: int, height: int) -> np.ndarray:
        """Return where points ``(n, 3)`` [m] in W appear ``(n, 2)``, from the left and from the top [pixel]."""
        right, up, forward = self.axes @ (np.asarray(points) - self.position).T
        scale = height / (2 * np.tan(self.field_of_view / 2))
        return np.stack([width / 2 + scale * right / forward, height / 2 - scale * up / forward], axis=-1)


def render(scene: StillLife, camera: Camera, width: int, height: int, *, samples: int = 2) -> np.ndarray:
    """Return a picture ``(height, width, 3)`` of floats 0 … 1; every pixel averages ``samples`` × ``samples`` rays."""
    data = mujoco.MjData(scene.model)
    mujoco.mj_fwdPosition(scene.model, data)
    offsets = (np.arange(samples) + 0.5) / samples - 0.5
    all_lights = _lights(camera)
    light = np.zeros((height * width, 3))
    for k, offset in enumerate((x, y) for y in offsets for x in offsets):
        lights = [(direction, weight * samples**2) for direction, weight in all_lights[k :: samples**2]]
        light += _colours(scene, data, camera, camera.rays(width, height, offset), lights)
    return np.clip(light / samples**2, 0.0, 1.0).reshape(height, width, 3) ** (1 / GAMMA)


def _colours(
    scene: StillLife,
    data: mujoco.MjData,
    camera: Camera,
    rays: np.ndarray,
    lights: list[tuple[np.ndarray, float]],
) -> np.ndarray:
    """Return what the camera sees along ``rays`` ``(n, 3)``: linear light ``(n, 3)``."""
    shape, distance, normal = _cast(scene, data, camera.position, rays)
    hit = np.flatnonzero(shape >= 0)
    points = camera.position + rays[hit] * distance[hit, None]
    colour = scene.colours[shape[hit]] ** GAMMA
    on_floor = shape[hit] == FLOOR
    colour[on_floor] *= 1 - _grid(points[on_floor])[:, None]
    shaded = ~on_floor | (np.linalg.norm(points - scene.centre, axis=1) < 2 * scene.radius)
    colour *= _brightness(scene, data, points, normal[hit], shaded, lights)[:, None]
    fade = on_floor * _smooth_step(np.linalg.norm(points - camera.target, axis=1), *FADE)
    result = np.broadcast_to(BACKGROUND, rays.shape).copy()
    result[hit] = colour + fade[:, None] * (BACKGROUND - colour)
    return result


def _brightness(
    scene: StillLife,
    data: mujoco.MjData,
    points: np.ndarray,
    normals: np.ndarray,
    shaded: np.ndarray,
    lights: list[tuple[np.ndarray, float]],
) -> np.ndarray:
    """Return the light ``(n,)`` on surfaces at ``points`` ``(n, 3)``; ``shaded`` ``(n,)`` ones may lie in shadow."""
    brightness = np.zeros(len(points))
    for direction, weight in lights:
        facing = np.maximum(normals @ direction, 0.0)
        asked = np.flatnonzero(shaded & (facing > 0))
        source = scene.centre + LIGHT_DISTANCE * direction
        rays = points[asked] - source
        distance = np.linalg.norm(rays, axis=1)
        _, nearest, _ = _cast(scene, data, source, rays / distance[:, None])
        facing[asked[nearest < distance - SHADOW_BIAS]] = 0.0
        brightness += weight * facing
    return brightness


def _cast(
    scene: StillLife, data: mujoco.MjData, origin: np.ndarray, rays: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what rays ``(n, 3)`` hit first: shape ``(n,)`` (−1: nothing), distance ``(n,)`` [m], normal ``(n, 3)``."""
    n = len(rays)
    shape, distance, normal = np.full(n, -1, dtype=np.int32), np.full(n, FAR), np.zeros(3 * n)
    if n:
        mujoco.mj_multiRay(scene.model, data, origin, rays.ravel(), None, True, -1, shape, distance, normal, n, FAR)
    return shape, np.where(shape >= 0, distance, FAR), normal.reshape(n, 3)


def _grid(points: np.ndarray) -> np.ndarray:
    """Return by how much the floor's lines darken it at ``points`` ``(n, 3)``: ``(n,)``."""
    darkness = np.zeros(len(points))
    for pitch, half_width, strength in GRID:
        offset = np.abs((points[:, :2] + pitch / 2) % pitch - pitch / 2).min(axis=1)
        darkness = np.maximum(darkness, strength * (offset < half_width))
    return darkness


def _smooth_step(x: np.ndarray, start: float, end: float) -> np.ndarray:
    t = np.clip((x - start) / (end - start), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def _lights(camera: Camera) -> list[tuple[np.ndarray, float]]:
    """Return direction ``(3,)`` and weight of all point lights; a floor in full light has brightness 1."""
    ahead = np.cross([0.0, 0.0, 1.0], camera.axes[0])
    sun = SUN_DIRECTION @ np.array([camera.axes[0], [0.0, 0.0, 1.0], ahead])
    sun = sun / np.linalg.norm(sun)
    right = np.cross(sun, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    angle = GOLDEN_ANGLE * np.arange(SUN_SAMPLES)
    radius = SUN_RADIUS * np.sqrt((np.arange(SUN_SAMPLES) + 0.5) / SUN_SAMPLES)
    disc = sun + np.outer(radius * np.cos(angle), right) + np.outer(radius * np.sin(angle), np.cross(sun, right))
    disc /= np.linalg.norm(disc, axis=1, keepdims=True)
    angle = GOLDEN_ANGLE * np.arange(SKY_SAMPLES)
    height = np.sqrt((np.arange(SKY_SAMPLES) + 0.5) / SKY_SAMPLES)  # spaced so that all weigh the same on a floor
    across = np.sqrt(1 - height**2)
    dome = np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)
    sun_weight = SUN_SHARE / disc[:, 2].sum()
    sky_weights = (1 - SUN_SHARE) / SKY_SAMPLES / np.maximum(height, 0.3)  # low lights capped: no glare on walls
    return [(d, sun_weight) for d in disc] + list(zip(dome, sky_weights, strict=True))
