"""Point contacts and the friction pyramid of thesis (3.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

_INDEPENDENT = 0.02  # least share of a row that others do not say; lengths of feet are centimetres


@dataclass(frozen=True, kw_only=True)
class ContactPoint:
    """A point of the robot that may carry load: the centre of a small sphere fixed to a URDF frame."""

    name: str
    frame: str  # URDF link that carries the sphere
    radius: float  # of the sphere [m]; the centre stands this high above the ground
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) of the centre, in the link's frame [m]


def friction_pyramid(friction_coefficient: float) -> np.ndarray:
    """Return W ``(5, 3)`` with W f ≥ 0 ⇔ |f_x| ≤ μ f_z, |f_y| ≤ μ f_z, f_z ≥ 0, for a force on the robot in W."""
    mu = friction_coefficient
    return np.array([[-1.0, 0.0, mu], [1.0, 0.0, mu], [0.0, -1.0, mu], [0.0, 1.0, mu], [0.0, 0.0, 1.0]])


def holding_rows(
    model: pin.Model, frames: Sequence[int], held: Sequence[bool], pose: np.ndarray
) -> tuple[tuple[int, int], ...]:
    """Return the pairs (contact point, axis) whose velocities are independent: all at rest, the held points are still.

    Several points of one link are fixed by fewer numbers than they have: two by five, three and more by six. The axes are
    those of the start heading frame for a robot in ``pose`` ``(n,)``; points of other links are independent.

    Args:
        model: of the robot.
        frames: Pinocchio frame of each contact point ``(n_c,)``.
        held: which points ``(n_c,)``.
        pose: in which it stands [rad].
    """
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.concatenate([np.zeros(6), [1.0], pose]))
    taken: dict[int, list[np.ndarray]] = {}  # link → orthonormal rows of those taken
    rows = []
    for i in (int(i) for i in np.flatnonzero(held)):
        frame = frames[i]
        basis = taken.setdefault(int(model.frames[frame].parentJoint), [])
        x, y, z = data.oMf[frame].translation - data.oMi[model.frames[frame].parentJoint].translation
        twist = np.array(
            [[1.0, 0, 0, 0, z, -y], [0, 1.0, 0, -z, 0, x], [0, 0, 1.0, y, -x, 0]]
        )  # of the link → of the point
        for axis in range(3):
            row = twist[axis] / np.linalg.norm(twist[axis])
            rest = row - sum(((row @ b) * b for b in basis), np.zeros(6))
            if np.linalg.norm(rest) > _INDEPENDENT:
                basis.append(rest / np.linalg.norm(rest))
                rows.append((i, axis))
    return tuple(rows)
