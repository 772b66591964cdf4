"""Point contacts and the friction pyramid of thesis (3.9)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class ContactPoint:
    """A point of the robot that may carry load: the centre of a small sphere fixed to a URDF frame."""

    name: str
    frame: str  # URDF link whose origin is the centre of the sphere
    radius: float  # of the sphere [m]; the centre stands this high above the ground


def friction_pyramid(friction_coefficient: float) -> np.ndarray:
    """Return W ``(5, 3)`` with W f ≥ 0 ⇔ |f_x| ≤ μ f_z, |f_y| ≤ μ f_z, f_z ≥ 0, for a force on the robot in W."""
    mu = friction_coefficient
    return np.array([[-1.0, 0.0, mu], [1.0, 0.0, mu], [0.0, -1.0, mu], [0.0, 1.0, mu], [0.0, 0.0, 1.0]])
