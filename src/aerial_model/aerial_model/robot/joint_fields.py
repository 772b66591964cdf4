"""Fields of ``robot.yaml`` that say something of joints, by the joint or by the kind of its actuator."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from aerial_model.config import closest, frozen_array
from aerial_model.errors import ConfigurationError
from aerial_model.robot.contact import ContactPoint

OFF_STOPS = 0.05  # that plans keep from joint stops [rad, m]: a leg that meets one lifts its foot
_FIRST_JOINT = 2  # in Pinocchio's model, after the universe and the free-flyer


def poses(data: Mapping[str, Any], joints: tuple[str, ...], where: str) -> dict[str, np.ndarray]:
    """Return the named poses, joint positions ``(n,)`` [rad]; landing and tuck are home where they are not given."""
    given = data["poses"]
    if not isinstance(given, Mapping):
        raise ConfigurationError(f"{where}: poses: expected a mapping of names to joint angles, found {given!r}")
    if "home" not in given:
        raise ConfigurationError(f"{where}: poses: 'home' is missing")
    named = {"landing": given["home"], "tuck": given["home"], **given}
    return {
        name: _per_joint(pose, data["actuators"], joints, f"{where}: poses: {name}", ()) for name, pose in named.items()
    }


def planning_range(
    data: Mapping[str, Any], joints: tuple[str, ...], model: pin.Model, where: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the greatest joint positions of plans ``(n,)`` [rad]: as given, else a little off the stops."""
    stops = np.stack([model.lowerPositionLimit + OFF_STOPS, model.upperPositionLimit - OFF_STOPS], axis=1)
    stops = stops[-len(joints) :]
    given = data.get("planning_range", {})
    kinds = data["actuators"]
    if isinstance(given, Mapping):
        kind_of = {joint: kind for kind, entry in kinds.items() for joint in entry["joints"]}
        left_out = [(j, s) for j, s in zip(joints, stops, strict=True) if not {j, kind_of[j]} & set(given)]
        given = {**given, **dict(left_out)}
    bounds = _per_joint(given, kinds, joints, f"{where}: planning_range", (2,))  # (n, 2)
    if np.any(bounds[:, 0] >= bounds[:, 1]):
        raise ConfigurationError(f"{where}: planning_range: the first number of a pair must be the smaller one")
    return frozen_array(bounds[:, 0]), frozen_array(bounds[:, 1])


def joint_mask(names: Any, joints: tuple[str, ...], where: str) -> np.ndarray:
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


def held_joints(
    names: Any, joints: tuple[str, ...], model: pin.Model, points: tuple[ContactPoint, ...], where: str
) -> np.ndarray:
    """Return which joints plans leave at home ``(n,)`` bool: some may, but none that carries a contact point."""
    mask = joint_mask(names, joints, where)
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
