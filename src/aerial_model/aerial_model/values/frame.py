"""The start heading frame S of a motion: the frame in which goals, terrain and plans are expressed."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, BASE_POSITION, Robot


@dataclass(frozen=True, kw_only=True, eq=False)
class StartFrame:
    """Where the start heading frame S lies in W: origin at the centre of the support on the ground, z up."""

    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) in W [m]
    heading: float = 0.0  # of its x axis, angle from W's about z [rad]

    @staticmethod
    def of(robot: Robot, q: np.ndarray, contact: np.ndarray | None = None) -> StartFrame:
        """Return the start heading frame of a robot at ``q`` ``(nq,)``, in the frame of q.

        Args:
            robot: that stands or moves there.
            q: its configuration.
            contact: the contact points that make the support ``(n_c,)`` bool; None: all.
        """
        points = robot.contact_positions(q)
        radii = np.array([point.radius for point in robot.contact_points])
        if contact is not None:
            points, radii = points[contact], radii[contact]
        origin = points.mean(axis=0) - [0.0, 0.0, radii.mean()]
        return StartFrame(origin=origin, heading=rotation.heading(q[BASE_ORIENTATION]))

    @property
    def orientation(self) -> np.ndarray:
        """Attitude of S in W ``(4,)``, quaternion xyzw."""
        return rotation.about_z(self.heading)

    @property
    def R_WS(self) -> np.ndarray:  # noqa: N802 (a symbol of the notation)
        """Rotation matrix ``(3, 3)`` that maps coordinates in S to coordinates in W."""
        return rotation.matrix(self.orientation)

    @property
    def R_SW(self) -> np.ndarray:  # noqa: N802 (a symbol of the notation)
        """Rotation matrix ``(3, 3)`` that maps coordinates in W to coordinates in S."""
        return rotation.matrix(rotation.about_z(-self.heading))

    @property
    def inverse(self) -> StartFrame:
        """Where W lies in S."""
        return StartFrame(origin=-self.R_SW @ self.origin, heading=-self.heading)

    def local(self, q: np.ndarray) -> np.ndarray:
        """Return configurations ``(..., nq)`` expressed in S, given in W."""
        turn = rotation.about_z(-self.heading)
        result = np.array(q, dtype=float)
        result[..., BASE_POSITION] = (result[..., BASE_POSITION] - self.origin) @ rotation.matrix(turn).T
        result[..., BASE_ORIENTATION] = rotation.multiply(turn, result[..., BASE_ORIENTATION])
        return result

    def on_floor(self, height: float) -> StartFrame:
        """Return this frame with its origin at ``height`` [m] in W."""
        return StartFrame(origin=np.array([self.origin[0], self.origin[1], height]), heading=self.heading)
