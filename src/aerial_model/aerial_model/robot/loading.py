"""Reading a robot's folder: ``robot.yaml`` on top of what it extends, held against its URDF, every mistake one sentence."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import reduce
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from aerial_model.config import check_keys, closest, from_mapping, load_yaml, merged, positive
from aerial_model.errors import ConfigurationError
from aerial_model.robot.actuator_kinds import actuator_law
from aerial_model.robot.contact import ContactPoint
from aerial_model.robot.joint_fields import held_joints, joint_mask, planning_range, poses
from aerial_model.robot.urdf import Description

YAML_NAME = "robot.yaml"
SECTIONS = ("planner", "controller", "sensors")  # each read, as a dataclass of its own, by the package it is for
USUAL_FRICTION = 0.495  # 0.7/√2: the pyramid (3.9) then lies inside the cone of the world's 0.7
_FIRST_JOINT = 2  # in Pinocchio's model, after the universe and the free-flyer


def known_robots() -> dict[str, Path]:
    """Return the robots that come with this package: name → folder."""
    root = Path(str(resources.files("aerial_model"))) / "robots"
    return {folder.name: folder for folder in sorted(root.iterdir()) if (folder / YAML_NAME).is_file()}


def find_folder(name_or_folder: str | Path) -> Path:
    """Return the folder of a robot given by name or path.

    Raises:
        ConfigurationError: if there is none, with the names that exist.
    """
    known = known_robots()
    if str(name_or_folder) in known:
        return known[str(name_or_folder)]
    folder = Path(name_or_folder).expanduser()
    if not folder.is_dir():
        raise ConfigurationError(
            f"no robot '{name_or_folder}'{closest(str(name_or_folder), known)}: "
            f"expected a folder or one of {', '.join(known)}"
        )
    if not (folder / YAML_NAME).is_file():
        raise ConfigurationError(f"robot folder {folder}: {YAML_NAME} is missing")
    return folder.resolve()


def _layers(folder: Path) -> list[tuple[Path, dict[str, Any]]]:
    """Return a robot's folder and those that it extends, each with what its ``robot.yaml`` says, the robot's own first."""
    layers: list[tuple[Path, dict[str, Any]]] = []
    below: Path | None = folder
    while below is not None:
        if below in [read for read, _ in layers]:
            raise ConfigurationError(f"{folder / YAML_NAME}: extends: '{below.name}' extends itself")
        layer = load_yaml(below / YAML_NAME)
        parent = layer.pop("extends", None)
        layers.append((below, layer))
        below = None if parent is None else _extended(parent, below)
    return layers


def _extended(parent: object, folder: Path) -> Path:
    """Return the folder that the key ``extends`` of a folder names: a robot of ours, or a path from there."""
    if not isinstance(parent, str):
        raise ConfigurationError(f"{folder / YAML_NAME}: extends: expected a robot's name or folder, found {parent!r}")
    return find_folder(parent if parent in known_robots() else folder / parent)


def read_robot(folder: Path) -> dict[str, Any]:
    """Return the fields of a ``Robot`` from its folder.

    Raises:
        ConfigurationError: with one sentence about what is missing, unknown or implausible.
    """
    where = str(folder / YAML_NAME)
    layers = _layers(folder)
    folders = tuple(path for path, _ in layers)
    data: dict[str, Any] = reduce(merged, (layer for _, layer in reversed(layers)))
    check_keys(
        data,
        required=["name", "contact_points", "bus_voltage", "actuators", "poses"],
        optional=[
            *("urdf", "fixed_joints", "total_mass", "planning_range", "friction_coefficient"),
            *("frozen_joints", "held_joints"),
            *SECTIONS,
        ],
        where=where,
    )
    total_mass = None if "total_mass" not in data else positive(data["total_mass"], f"{where}: total_mass")
    fixed = data.get("fixed_joints", [])
    description = Description.read(data.get("urdf"), folders, where=where, total_mass=total_mass, fixed_joints=fixed)
    model = _pinocchio_model(description)
    joints = tuple(str(name) for name in model.names[_FIRST_JOINT:])
    actuators = actuator_law(data["actuators"], joints, data["bus_voltage"], where)
    model.armature = np.concatenate([np.zeros(6), actuators.armature])
    points = _contact_points(data["contact_points"], model, where)
    frames = tuple(_contact_frame(model, point) for point in points)
    friction = data.get("friction_coefficient", USUAL_FRICTION)
    return {
        "name": str(data["name"]),
        "folders": folders,
        "description": description,
        "model": model,
        "joint_names": joints,
        "contact_points": points,
        "contact_frames": frames,
        "actuators": actuators,
        "poses": poses(data, joints, where),
        "planning_range": planning_range(data, joints, model, where),
        "frozen_joints": joint_mask(data.get("frozen_joints", []), joints, f"{where}: frozen_joints"),
        "held_joints": held_joints(data.get("held_joints", []), joints, model, points, f"{where}: held_joints"),
        "friction_coefficient": positive(friction, f"{where}: friction_coefficient"),
        "model_hash": _content_hash(description, data),
        "sections": {name: data[name] for name in SECTIONS if name in data},
    }


def _pinocchio_model(description: Description) -> pin.Model:
    """Return the model of a robot with a free base, each of whose joints one number describes."""
    urdf = description.path
    try:
        model = pin.buildModelFromXML(description.text, pin.JointModelFreeFlyer())
    except (ValueError, RuntimeError) as error:
        raise ConfigurationError(f"{urdf}: not a URDF that Pinocchio can read ({error})") from None
    for joint_id in range(_FIRST_JOINT, model.njoints):
        joint = model.joints[joint_id]
        if joint.nq != 1 or joint.nv != 1:
            raise ConfigurationError(
                f"{urdf}: joint '{model.names[joint_id]}' is of kind {joint.shortname()}; "
                "expected a revolute or prismatic joint with limits"
            )
    return model


def _contact_points(entries: Any, model: pin.Model, where: str) -> tuple[ContactPoint, ...]:
    """Return the contact points that ``robot.yaml`` lists, on links that the URDF has."""
    if not isinstance(entries, list) or not entries:
        raise ConfigurationError(f"{where}: contact_points: expected a list of points, found {entries!r}")
    points = tuple(
        from_mapping(ContactPoint, entry, f"{where}: contact_points[{i}]") for i, entry in enumerate(entries)
    )
    for point in points:
        if not model.existFrame(point.frame, pin.FrameType.BODY):
            raise ConfigurationError(
                f"{where}: contact_points: {point.name}: the URDF has no link '{point.frame}'"
                f"{closest(point.frame, [frame.name for frame in model.frames])}"
            )
        if np.shape(point.offset) != (3,):
            raise ConfigurationError(f"{where}: contact_points: {point.name}: offset: expected three numbers")
        if point.radius <= 0:
            raise ConfigurationError(f"{where}: contact_points: {point.name}: radius must be positive")
    if len({point.name for point in points}) != len(points):
        raise ConfigurationError(f"{where}: contact_points: names must differ")
    return points


def _contact_frame(model: pin.Model, point: ContactPoint) -> int:
    """Return the Pinocchio frame at the centre of a contact point, added to the model if no link lies there."""
    link = model.getFrameId(point.frame)
    if not np.any(point.offset):
        return link
    parent = model.frames[link]
    placement = parent.placement * pin.SE3(np.eye(3), np.array(point.offset))
    return model.addFrame(
        pin.Frame(f"contact {point.name}", parent.parentJoint, link, placement, pin.FrameType.OP_FRAME)
    )


def _content_hash(description: Description, data: Mapping[str, Any]) -> str:
    """Return what differs between two robots whose files differ in content, 16 hexadecimal digits."""
    digest = hashlib.sha256(description.path.read_bytes())
    digest.update(json.dumps(data, sort_keys=True, default=str).encode())
    return digest.hexdigest()[:16]
