"""A URDF as the draft sees it: its kinematic tree and collision shapes, in the base's axes with all joints at zero."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from aerial_model.errors import ConfigurationError
from aerial_model.robot.urdf import Description

FIRST_JOINT = 2  # of Pinocchio's joints, after the universe and the free-flyer
_RANGES = 0.05  # [rad] that poses keep from stops
_LATERAL = 0.7  # of an axis along y, from which a joint turns about the lateral axis


class Mechanism:
    """The model and its shapes, and what can be asked of them at the zero pose.

    Args:
        urdf: the file.
        fixed_joints: that are to be held at zero.

    Raises:
        ConfigurationError: if it is no URDF of a robot with legs.
    """

    def __init__(self, urdf: Path, fixed_joints: Sequence[str] = ()) -> None:
        description = Description.read(urdf, (urdf.parent,), where=str(urdf), fixed_joints=fixed_joints)
        try:
            model = pin.buildModelFromXML(description.text, pin.JointModelFreeFlyer())
            shapes = pin.buildGeomFromUrdfString(model, description.text, pin.GeometryType.COLLISION)
        except (ValueError, RuntimeError) as error:
            raise ConfigurationError(f"{urdf}: not a URDF that Pinocchio can read ({error})") from None
        if model.njoints < FIRST_JOINT + 2:
            moving = model.njoints - FIRST_JOINT
            raise ConfigurationError(f"{urdf}: a robot that jumps has legs; this one has {moving} joints that move")
        self.urdf = urdf
        self.model: pin.Model = model
        self.shapes: list[pin.GeometryObject] = list(shapes.geometryObjects)
        self.data: pin.Data = model.createData()  # at zero
        self.limits = (model.lowerPositionLimit[7:] + _RANGES, model.upperPositionLimit[7:] - _RANGES)  # of poses
        pin.framesForwardKinematics(model, self.data, pin.neutral(model))
        pin.centerOfMass(model, self.data, pin.neutral(model))

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints that move, in the order of q_j."""
        return [str(name) for name in self.model.names[FIRST_JOINT:]]

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return float(pin.computeTotalMass(self.model))

    def index(self, joint: int) -> int:
        """Return where a Pinocchio joint stands in q_j."""
        return int(self.model.joints[joint].idx_v) - 6

    def axis(self, joint: int) -> np.ndarray:
        """Return a joint's axis ``(3,)`` in the base."""
        data = self.model.joints[joint].createData()
        self.model.joints[joint].calc(data, np.zeros(1), np.zeros(1))
        subspace = np.asarray(data.S).reshape(6)
        return self.data.oMi[joint].rotation @ (subspace[3:] if np.any(subspace[3:]) else subspace[:3])

    def is_lateral(self, joint: int) -> bool:
        """Return whether a joint swings what it carries fore and aft: it turns about the lateral axis."""
        return bool(abs(self.axis(joint)[1]) > _LATERAL)

    def ends(self) -> list[int]:
        """Return the Pinocchio joints that carry no other."""
        return [j for j in range(FIRST_JOINT, self.model.njoints) if not len(self.model.children[j])]

    def chain(self, joint: int) -> tuple[int, ...]:
        """Return the Pinocchio joints from the body to one, itself included."""
        return tuple(list(self.model.supports[joint])[FIRST_JOINT:])

    def offset_in(self, frame: int, in_joint: np.ndarray) -> np.ndarray:
        """Return in a frame the coordinates ``(3,)`` [m] of a point given in the frame's joint."""
        placement = self.model.frames[frame].placement
        return placement.rotation.T @ (np.asarray(in_joint) - placement.translation)


def in_base(data: pin.Data, frame: int, offset: np.ndarray) -> np.ndarray:
    """Return in the base the coordinates ``(3,)`` [m] of a point given in a frame, as the data's frames are placed."""
    placement = data.oMf[frame]
    return placement.translation + placement.rotation @ offset
