"""Pictures of a motion: one that shows several moments of it at once, or a sequence of frames.

Everything is shown in the start heading frame, so that the same motion looks the same from any start.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from PIL import Image

from aerial_model.robot.robot import BASE_POSITION, Robot
from aerial_model.values.frame import StartFrame
from aerial_model.values.terrain import Terrain
from aerial_sim.picture.raycast import Camera, render
from aerial_sim.picture.still_life import compose

SETTLED = 0.6  # after the landing the last moment is shown [s]
FIELD_OF_VIEW = np.radians(22.0)  # [rad] a long lens keeps proportions
ELEVATION = np.radians(13.0)  # of the camera above the horizontal [rad]
SIDEWAYS = np.radians(9.0)  # from a straight look across the motion [rad]
MARGIN = 0.12  # around what must be seen [m]
SPACING = 0.25  # of the moments shown of a flight, along the path of the base [m]
MOMENTS_MAX = 2  # of a flight: more hide one another
PALEST = 0.65  # of the first moment; the last has its own colours
STEP_MIN = 0.05  # a shorter way is no direction to look across [m]
TRAIL_PERIOD = 0.02  # between the dots of the path of the centre of mass [s]
TRAIL_COLOUR = np.array([0.90, 0.36, 0.11])
TRAIL_RADIUS = 0.005  # over the picture's height


@dataclass(frozen=True, kw_only=True, eq=False)
class Footage:
    """A motion as it was, in its start heading frame."""

    robot: Robot
    terrain: Terrain
    time: np.ndarray  # (T,) from the start of the motion, negative before [s]
    q: np.ndarray  # (T, nq)
    take_off_time: float  # [s]
    landing_time: float  # [s]

    @staticmethod
    def of(
        robot: Robot,
        terrain: Terrain,
        time: np.ndarray,
        q: np.ndarray,
        *,
        start_time: float,
        take_off_time: float,
        landing_time: float,
    ) -> Footage:
        """Return the footage of a motion given in W.

        Args:
            robot: that moved.
            terrain: in W.
            time: of the configurations ``(T,)`` [s].
            q: configurations ``(T, nq)``.
            start_time: when the motion began, on the clock of ``time`` [s].
            take_off_time: after the start [s].
            landing_time: after the start [s].
        """
        time = np.asarray(time) - start_time
        frame = StartFrame.of(robot, q[np.searchsorted(time, 0.0)])
        return Footage(
            robot=robot,
            terrain=terrain.placed(frame.inverse),
            time=time,
            q=frame.local(q),
            take_off_time=take_off_time,
            landing_time=landing_time,
        )

    def at(self, time: float) -> np.ndarray:
        """Return the configuration ``(nq,)`` recorded next to ``time`` [s]."""
        return self.q[int(np.argmin(np.abs(self.time - time)))]

    @property
    def moments(self) -> np.ndarray:
        """Times that tell the motion ``(m,)`` [s]: start, take-off, some of the flight, the robot standing again."""
        flight = (self.time >= self.take_off_time) & (self.time <= self.landing_time)
        path = np.linalg.norm(np.diff(self.q[flight, BASE_POSITION], axis=0), axis=1).sum()
        shown = int(np.clip(path / SPACING, 1, MOMENTS_MAX))
        between = np.linspace(self.take_off_time, self.landing_time, shown + 2)[1:-1]
        return np.array([0.0, *between, self.landing_time + SETTLED])


def strobe(footage: Footage, width: int = 1200, height: int = 600, *, samples: int = 2) -> np.ndarray:
    """Return one picture ``(height, width, 3)``, 0 … 1, of the motion's moments and the path of its centre of mass."""
    poses = [footage.at(moment) for moment in footage.moments]
    camera = _camera(footage, np.array(poses), width / height)
    scene = compose(footage.robot, footage.terrain, poses, np.linspace(PALEST, 0.0, len(poses)).tolist())
    image = render(scene, camera, width, height, samples=samples)
    dots = np.arange(footage.take_off_time, footage.landing_time, TRAIL_PERIOD)
    trail = np.array([_centre_of_mass(footage.robot, footage.at(moment)) for moment in dots])
    for x, y in camera.project(trail, width, height):
        _draw_dot(image, x, y, TRAIL_RADIUS * height)
    return image


def frames(
    footage: Footage, rate: float, width: int = 480, height: int = 270, *, samples: int = 2
) -> Iterator[np.ndarray]:
    """Yield pictures ``(height, width, 3)``, 0 … 1, from start to landing and a little on, ``rate`` [1/s] of them."""
    poses = np.array([footage.at(moment) for moment in footage.moments])
    camera = _camera(footage, poses, width / height)
    for time in np.arange(0.0, footage.landing_time + SETTLED, 1 / rate):
        yield render(
            compose(footage.robot, footage.terrain, [footage.at(time)]), camera, width, height, samples=samples
        )


def save(image: np.ndarray, path: Path) -> None:
    """Write a picture ``(height, width, 3)``, 0 … 1, as a PNG file."""
    _bytes(image).save(path, format="PNG")


def save_animation(images: Iterator[np.ndarray], rate: float, path: Path) -> None:
    """Write pictures, 0 … 1, as an endless GIF that shows ``rate`` [1/s] of them."""
    first, *rest = [_bytes(image) for image in images]
    first.save(path, format="GIF", save_all=True, append_images=rest, duration=round(1000 / rate), loop=0)


def _bytes(image: np.ndarray) -> Image.Image:
    return Image.fromarray((255 * image).round().astype(np.uint8))


def _camera(footage: Footage, poses: np.ndarray, aspect: float) -> Camera:
    """Return a camera that looks across the motion's direction and sees all of ``poses`` ``(m, nq)``."""
    way = poses[-1, :2] - poses[0, :2]
    along = np.arctan2(way[1], way[0]) if np.linalg.norm(way) > STEP_MIN else 0.0
    azimuth = along - np.pi / 2 + SIDEWAYS
    towards = np.array(
        [np.cos(azimuth) * np.cos(ELEVATION), np.sin(azimuth) * np.cos(ELEVATION), np.sin(ELEVATION)]
    )  # the camera, seen from the middle
    seen = np.concatenate([_outline(footage.robot, q) for q in poses])
    target = (seen.min(axis=0) + seen.max(axis=0)) / 2
    right, up, forward = Camera(position=target + towards, target=target, field_of_view=FIELD_OF_VIEW).axes
    offset = seen - target
    half = np.tan(FIELD_OF_VIEW / 2)
    needed = np.maximum((np.abs(offset @ right) + MARGIN) / (half * aspect), (np.abs(offset @ up) + MARGIN) / half)
    distance = float(np.max(needed - offset @ forward))
    return Camera(position=target + distance * towards, target=target, field_of_view=FIELD_OF_VIEW)


def _outline(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return the positions of all joints and contact points ``(k, 3)`` [m]: roughly where the robot is."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    joints = [data.oMi[joint].translation for joint in range(1, robot.model.njoints)]
    return np.array(joints + [data.oMf[frame].translation for frame in robot.contact_frames])


def _centre_of_mass(robot: Robot, q: np.ndarray) -> np.ndarray:
    return pin.centerOfMass(robot.model, robot.model.createData(), q).copy()


def _draw_dot(image: np.ndarray, x: float, y: float, radius: float) -> None:
    """Draw a disc with soft edges at ``x``, ``y`` [pixel] into ``image``."""
    rows, columns = np.ogrid[: image.shape[0], : image.shape[1]]
    cover = np.clip(radius + 0.5 - np.hypot(columns + 0.5 - x, rows + 0.5 - y), 0.0, 1.0)[..., None]
    image += cover * (TRAIL_COLOUR - image)
