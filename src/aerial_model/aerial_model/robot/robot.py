"""A robot is data: a folder with ``robot.urdf`` and ``robot.yaml``; Pinocchio, CasADi and MuJoCo models all come from it.

What the folder holds beyond that is optional: ``extends`` makes it a variant of another, ``urdf`` names a file elsewhere,
``motions/`` has motions of its own.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin

from aerial_model.config import closest, from_mapping, merged
from aerial_model.errors import ConfigurationError
from aerial_model.numerics.rotation import IDENTITY
from aerial_model.robot.actuator import ActuatorLaw
from aerial_model.robot.contact import ContactPoint, holding_rows
from aerial_model.robot.loading import SECTIONS, YAML_NAME, find_folder, read_robot
from aerial_model.robot.scale import REFERENCE_HEIGHT, REFERENCE_MASS, Scale
from aerial_model.robot.urdf import Description

T = TypeVar("T")

BASE_POSITION = slice(0, 3)  # in q
BASE_ORIENTATION = slice(3, 7)  # in q
JOINT_POSITION = slice(7, None)  # in q
BASE_TWIST = slice(0, 6)  # in v
BASE_LINEAR = slice(0, 3)  # in v
BASE_ANGULAR = slice(3, 6)  # in v
JOINT_VELOCITY = slice(6, None)  # in v

GRAVITY = 9.81  # [m/s²]


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot:
    """Everything that is known about a robot, loaded by ``Robot.load``."""

    name: str
    folders: tuple[Path, ...]  # its own, then those it extends
    description: Description
    model: pin.Model  # with a free-flyer base; rotor inertia as armature
    joint_names: tuple[str, ...]  # actuated joints in the order of q and v
    contact_points: tuple[ContactPoint, ...]
    contact_frames: tuple[int, ...]  # Pinocchio frame of each contact point
    actuators: ActuatorLaw
    poses: Mapping[str, np.ndarray]  # name → joint positions (n,) [rad]
    planning_range: tuple[np.ndarray, np.ndarray]  # least and greatest joint position of a plan, (n,) each [rad]
    frozen_joints: np.ndarray  # (n,) bool, whose angle AAKD* takes as fixed
    held_joints: np.ndarray  # (n,) bool, which plans leave at home
    friction_coefficient: float  # that planner and controller count on
    model_hash: str  # of both files' content: a plan is for exactly this robot
    sections: Mapping[str, Any]  # the rest of robot.yaml, unparsed

    @property
    def n_joints(self) -> int:
        """Number of actuated joints."""
        return len(self.joint_names)

    @property
    def n_contacts(self) -> int:
        """Number of contact points."""
        return len(self.contact_points)

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return float(pin.computeTotalMass(self.model))

    @property
    def folder(self) -> Path:
        """The robot's own folder."""
        return self.folders[0]

    @cached_property
    def scale(self) -> Scale:
        """How large it is beside the reference robot, to a thousandth."""
        q = self.standing_configuration()
        height = pin.centerOfMass(self.model, self.model.createData(), q)[2]
        return Scale(mass=round(self.mass / REFERENCE_MASS, 3), length=round(float(height) / REFERENCE_HEIGHT, 3))

    @cached_property
    def strength(self) -> float:
        """Greatest force on all contact points, straight up at home, in weights: what the weakest joint can push."""
        q = self.standing_configuration()
        data = self.model.createData()
        pin.computeJointJacobians(self.model, data, q)
        pin.updateFramePlacements(self.model, data)
        share = self.mass * GRAVITY / self.n_contacts
        axes = pin.LOCAL_WORLD_ALIGNED
        torque = sum(share * pin.getFrameJacobian(self.model, data, f, axes)[2] for f in self.contact_frames)
        return float(np.min(self.actuators.torque_max / np.maximum(np.abs(torque[JOINT_VELOCITY]), 1e-9)))

    def section(self, name: str, cls: type[T]) -> T:
        """Return a section of ``robot.yaml`` as the dataclass that reads it.

        What the section leaves out comes from ``cls.defaults(scale)``, a mapping, if the class has it.

        Raises:
            ConfigurationError: for a missing or unknown key.
        """
        defaults: Mapping[str, Any] = getattr(cls, "defaults", lambda scale: {})(self.scale)
        said = self.sections.get(name, {})
        if isinstance(said, Mapping):
            said = merged(defaults, said)
        return from_mapping(cls, said, f"{self.folder / YAML_NAME}: {name}")

    def with_section(self, name: str, **changes: Any) -> Robot:
        """Return this robot with keys of a section replaced, as ``--set section.key=value`` asks.

        Raises:
            ConfigurationError: if there is no such section.
        """
        if name not in SECTIONS:
            known = ", ".join(SECTIONS)
            raise ConfigurationError(f"unknown section '{name}'{closest(name, SECTIONS)}; known: {known}")
        sections = {**self.sections, name: merged(self.sections.get(name, {}), changes)}
        return dataclasses.replace(self, sections=sections)

    def standing_configuration(self, pose: str = "home") -> np.ndarray:
        """Return q ``(nq,)`` in a named pose, level, its support centre at the origin and the lowest contact on z = 0."""
        q = np.concatenate([np.zeros(3), IDENTITY, self.poses[pose]])
        points = self.contact_positions(q)
        radii = np.array([point.radius for point in self.contact_points])
        q[:2] = -points[:, :2].mean(axis=0)
        q[2] = -np.min(points[:, 2] - radii)
        return q

    def contact_positions(self, q: np.ndarray) -> np.ndarray:
        """Return the centres of the contact spheres ``(n_c, 3)`` [m] in W at configuration ``q`` ``(nq,)``."""
        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, q)
        return np.array([data.oMf[frame].translation for frame in self.contact_frames])

    def mass_matrices(self, q_j: np.ndarray) -> np.ndarray:
        """Return mass matrices H ``(K, nv, nv)``, rotor inertia included, with the joints at ``q_j`` ``(K, n)`` [rad]."""
        data = self.model.createData()
        M = np.zeros((len(q_j), self.model.nv, self.model.nv))  # at first what is right of the diagonal
        q = np.concatenate([np.zeros(3), IDENTITY, np.zeros(self.n_joints)])  # it does not depend on the base
        for k, positions in enumerate(q_j):
            q[JOINT_POSITION] = positions
            M[k] = pin.crba(self.model, data, q)
        below = np.tril_indices(self.model.nv, -1)
        M[:, below[0], below[1]] = M[:, below[1], below[0]]
        return M

    @property
    def contact_links(self) -> np.ndarray:
        """Which joint's link each contact point belongs to ``(n_c,)`` int."""
        return np.array([self.model.frames[frame].parentJoint for frame in self.contact_frames])

    @cached_property
    def arms(self) -> np.ndarray:
        """Indices of the joints that carry no contact point ``(n_a,)``: nothing but angular momentum needs them."""
        carrying = {joint for link in self.contact_links for joint in self.model.supports[int(link)]}
        joints = range(2, self.model.njoints)
        return np.array(
            [self.model.joints[j].idx_v - JOINT_VELOCITY.start for j in joints if j not in carrying], dtype=int
        )

    @property
    def planned_joints(self) -> np.ndarray:
        """Indices of the joints that plans move ``(n_p,)``."""
        return np.flatnonzero(~self.held_joints)

    @cached_property
    def planned(self) -> Robot:
        """This robot as plans see it, without its held joints: they are welded at home. Itself if it has none."""
        if not self.held_joints.any():
            return self
        joints = self.planned_joints
        held = [self.model.getJointId(name) for name in np.array(self.joint_names)[self.held_joints]]
        model = pin.buildReducedModel(self.model, held, self.standing_configuration())
        actuators = self.actuators.of(joints)
        model.armature = np.concatenate([np.zeros(6), actuators.armature])
        names = [self.model.frames[frame].name for frame in self.contact_frames]
        low, high = self.planning_range
        return dataclasses.replace(
            self,
            model=model,
            joint_names=tuple(self.joint_names[j] for j in joints),
            contact_frames=tuple(model.getFrameId(name) for name in names),
            actuators=actuators,
            poses={name: pose[joints] for name, pose in self.poses.items()},
            planning_range=(low[joints], high[joints]),
            frozen_joints=self.frozen_joints[joints],
            held_joints=np.zeros(len(joints), dtype=bool),
        )

    def with_held(self, q_j: np.ndarray) -> np.ndarray:
        """Return the positions of all joints ``(..., n)`` [rad] given those that plans move ``(..., n_p)``."""
        whole = np.broadcast_to(self.poses["home"], (*q_j.shape[:-1], self.n_joints)).copy()
        whole[..., self.planned_joints] = q_j
        return whole

    def holding_rows(self, held: Sequence[bool]) -> tuple[tuple[int, int], ...]:
        """Return the pairs (contact point, axis) that suffice to hold points ``(n_c,)`` still; see ``contact``."""
        return holding_rows(self.model, self.contact_frames, held, self.poses["home"])

    @staticmethod
    def load(name_or_folder: str | Path) -> Robot:
        """Return the robot of that name among those that come with this package, or of that folder.

        Raises:
            ConfigurationError: with one sentence about what is missing, unknown or implausible.
        """
        return Robot(**read_robot(find_folder(name_or_folder)))
