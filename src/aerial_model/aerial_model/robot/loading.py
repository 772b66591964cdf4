"""Reading a robot's folder: ``robot.yaml`` on top of what it extends, held against its URDF, every mistake one sentence."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from aerial_model.config import check_keys, closest, from_mapping, frozen_array, load_yaml, merged
from aerial_model.errors import ConfigurationError
from aerial_model.robot.actuator import ActuatorLaw
from aerial_model.robot.contact import ContactPoint
from aerial_model.robot.urdf import Description

YAML_NAME = "robot.yaml"
SECTIONS = ("planner", "controller", "sensors")  # each read, as a dataclass of its own, by the package it is for
OFF_STOPS = 0.05  # that plans keep from joint stops [rad, m]: a leg that meets one lifts its foot
USUAL_FRICTION = 0.495  # 0.7/√2: the pyramid (3.9) then lies inside the cone of the world's 0.7
_FIRST_JOINT = 2  # in Pinocchio's model, after the universe and the free-flyer


@dataclass(frozen=True, kw_only=True)
class _ActuatorEntry:
    """One kind of actuator in ``robot.yaml``; units as in ``ActuatorLaw``."""

    joints: tuple
    gear_ratio: float
    torque_max: float
    torque_constant: float
    back_emf_constant: float
    resistance: float
    rotor_inertia: float
    damping: float
    dry_friction: float

    def __post_init__(self) -> None:
        for name in ("gear_ratio", "torque_max", "torque_constant", "back_emf_constant", "resistance"):
            if getattr(self, name) <= 0:
                raise ValueError(f"{name} must be positive, found {getattr(self, name)}")
        for name in ("rotor_inertia", "damping", "dry_friction"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must not be negative, found {getattr(self, name)}")


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


def _read(folder: Path) -> tuple[dict[str, Any], tuple[Path, ...]]:
    """Return what ``robot.yaml`` says, on top of what it extends, and the folders read."""
    folders: list[Path] = []
    layers: list[dict[str, Any]] = []
    while folder is not None:
        if folder in folders:
            raise ConfigurationError(f"{folders[0] / YAML_NAME}: extends: '{folder.name}' extends itself")
        layer = load_yaml(folder / YAML_NAME)
        folders.append(folder)
        layers.append(layer)
        parent = layer.pop("extends", None)
        if parent is not None and not isinstance(parent, str):
            raise ConfigurationError(
                f"{folder / YAML_NAME}: extends: expected a robot's name or folder, found {parent!r}"
            )
        if parent is not None and parent not in known_robots():
            parent = folder / parent  # as everything a file names: relative to where it lies
        folder = None if parent is None else find_folder(parent)
    data: dict[str, Any] = {}
    for layer in reversed(layers):
        data = merged(data, layer)
    return data, tuple(folders)


def read_robot(folder: Path) -> dict[str, Any]:
    """Return the fields of a ``Robot`` from its folder.

    Raises:
        ConfigurationError: with one sentence about what is missing, unknown or implausible.
    """
    where = str(folder / YAML_NAME)
    data, folders = _read(folder)
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
    total_mass = None if "total_mass" not in data else _positive(data["total_mass"], f"{where}: total_mass")
    fixed = data.get("fixed_joints", [])
    description = Description.read(data.get("urdf"), folders, where=where, total_mass=total_mass, fixed_joints=fixed)
    model = _pinocchio_model(description)
    joints = tuple(str(name) for name in model.names[_FIRST_JOINT:])
    actuators = _actuator_law(data["actuators"], joints, data["bus_voltage"], where)
    model.armature = np.concatenate([np.zeros(6), actuators.armature])
    points = _contact_points(data["contact_points"], model, where)
    frames = tuple(_contact_frame(model, point) for point in points)
    poses = _poses(data, joints, where)
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
        "poses": poses,
        "planning_range": _planning_range(data, joints, model, where),
        "frozen_joints": _joint_mask(data.get("frozen_joints", []), joints, f"{where}: frozen_joints"),
        "held_joints": _held_joints(data.get("held_joints", []), joints, model, points, f"{where}: held_joints"),
        "friction_coefficient": _positive(friction, f"{where}: friction_coefficient"),
        "model_hash": _content_hash(description, data),
        "sections": {name: data[name] for name in SECTIONS if name in data},
    }


def _pinocchio_model(description: Description) -> pin.Model:
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


def _actuator_law(kinds: Any, joints: tuple[str, ...], bus_voltage: Any, where: str) -> ActuatorLaw:
    if not isinstance(kinds, Mapping):
        raise ConfigurationError(f"{where}: actuators: expected a mapping of kinds, found {kinds!r}")
    entry_of: dict[str, _ActuatorEntry] = {}
    for kind, mapping in kinds.items():
        entry = from_mapping(_ActuatorEntry, mapping, f"{where}: actuators: {kind}")
        for joint in entry.joints:
            if joint not in joints:
                raise ConfigurationError(
                    f"{where}: actuators: {kind}: the URDF has no joint '{joint}'{closest(str(joint), joints)}; "
                    f"it has {', '.join(joints)}"
                )
            if joint in entry_of:
                raise ConfigurationError(f"{where}: actuators: joint '{joint}' is listed twice")
            entry_of[joint] = entry
    missing = [joint for joint in joints if joint not in entry_of]
    if missing:
        raise ConfigurationError(f"{where}: actuators: no entry for joint {', '.join(missing)}")
    names = [field.name for field in dataclasses.fields(_ActuatorEntry) if field.name != "joints"]
    columns = {name: frozen_array([getattr(entry_of[joint], name) for joint in joints]) for name in names}
    voltage = _positive(bus_voltage, f"{where}: bus_voltage")
    return ActuatorLaw(bus_voltage=frozen_array(np.full(len(joints), voltage)), **columns)


def _contact_points(entries: Any, model: pin.Model, where: str) -> tuple[ContactPoint, ...]:
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


def _per_joint(
    values: Any, kinds: Mapping[str, Any], joints: tuple[str, ...], where: str, shape: tuple[int, ...]
) -> np.ndarray:
    """Return ``(n, *shape)`` from a mapping that names kinds of actuators, or single joints (which win over kinds)."""
    if not isinstance(values, Mapping):
        raise ConfigurationError(f"{where}: expected a mapping of joint kinds or joints to values, found {values!r}")
    kind_of = {joint: kind for kind, entry in kinds.items() for joint in entry["joints"]}
    for name in values:
        if name not in kinds and name not in joints:
            known = [*kinds, *joints]
            raise ConfigurationError(
                f"{where}: unknown joint or kind '{name}'{closest(str(name), known)}; known: {', '.join(known)}"
            )
    rows = []
    for joint in joints:
        name = joint if joint in values else kind_of[joint]
        if name not in values:
            raise ConfigurationError(f"{where}: no value for joint '{joint}' (kind '{kind_of[joint]}')")
        rows.append(frozen_array(values[name], f"{where}: {name}", shape))
    return frozen_array(rows)


def _poses(data: Mapping[str, Any], joints: tuple[str, ...], where: str) -> dict[str, np.ndarray]:
    poses = data["poses"]
    if not isinstance(poses, Mapping):
        raise ConfigurationError(f"{where}: poses: expected a mapping of names to joint angles, found {poses!r}")
    if "home" not in poses:
        raise ConfigurationError(f"{where}: poses: 'home' is missing")
    poses = {"landing": poses["home"], "tuck": poses["home"], **poses}
    return {
        name: _per_joint(pose, data["actuators"], joints, f"{where}: poses: {name}", ()) for name, pose in poses.items()
    }


def _planning_range(
    data: Mapping[str, Any], joints: tuple[str, ...], model: pin.Model, where: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return what ``planning_range`` says; joints it leaves out keep a little off the URDF's stops."""
    stops = np.stack([model.lowerPositionLimit + OFF_STOPS, model.upperPositionLimit - OFF_STOPS], axis=1)
    stops = stops[-len(joints) :]
    said = data.get("planning_range", {})
    kinds = data["actuators"]
    if isinstance(said, Mapping):
        kind_of = {joint: kind for kind, entry in kinds.items() for joint in entry["joints"]}
        left_out = [(j, s) for j, s in zip(joints, stops, strict=True) if not {j, kind_of[j]} & set(said)]
        said = {**said, **dict(left_out)}
    bounds = _per_joint(said, kinds, joints, f"{where}: planning_range", (2,))  # (n, 2)
    if np.any(bounds[:, 0] >= bounds[:, 1]):
        raise ConfigurationError(f"{where}: planning_range: the first number of a pair must be the smaller one")
    return frozen_array(bounds[:, 0]), frozen_array(bounds[:, 1])


def _joint_mask(names: Any, joints: tuple[str, ...], where: str) -> np.ndarray:
    """Return which joints are named ``(n,)`` bool."""
    if not isinstance(names, list):
        raise ConfigurationError(f"{where}: expected a list of joints, found {names!r}")
    for name in names:
        if name not in joints:
            raise ConfigurationError(f"{where}: the URDF has no joint '{name}'{closest(str(name), joints)}")
        if names.count(name) > 1:
            raise ConfigurationError(f"{where}: joint '{name}' is listed twice")
    mask = np.array([joint in names for joint in joints])
    mask.flags.writeable = False
    return mask


def _held_joints(
    names: Any, joints: tuple[str, ...], model: pin.Model, points: tuple[ContactPoint, ...], where: str
) -> np.ndarray:
    mask = _joint_mask(names, joints, where)
    if mask.all():
        raise ConfigurationError(f"{where}: all joints are held; a plan needs some to move")
    for point in points:
        link = model.frames[model.getFrameId(point.frame, pin.FrameType.BODY)].parentJoint
        for joint in list(model.supports[link])[_FIRST_JOINT:]:
            if mask[joint - _FIRST_JOINT]:
                raise ConfigurationError(
                    f"{where}: joint '{model.names[joint]}' carries contact point '{point.name}'; "
                    "only joints that carry none can be held"
                )
    return mask


def _positive(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not value > 0:
        raise ConfigurationError(f"{where}: expected a positive number, found {value!r}")
    return float(value)


def _content_hash(description: Description, data: Mapping[str, Any]) -> str:
    digest = hashlib.sha256(description.path.read_bytes())
    digest.update(json.dumps(data, sort_keys=True, default=str).encode())
    return digest.hexdigest()[:16]
