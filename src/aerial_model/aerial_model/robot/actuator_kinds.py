"""The section ``actuators`` of ``robot.yaml``: kinds of actuators, each with the joints that have it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerial_model.config import closest, from_mapping, frozen_array, positive
from aerial_model.errors import ConfigurationError
from aerial_model.robot.actuator import ActuatorLaw


@dataclass(frozen=True, kw_only=True)
class _ActuatorEntry:
    """One kind of actuator in ``robot.yaml``; units as in ``ActuatorLaw``."""

    joints: tuple[str, ...]
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


def actuator_law(kinds: Any, joints: tuple[str, ...], bus_voltage: Any, where: str) -> ActuatorLaw:
    """Return the law of all joints, from entries that name theirs; every joint is in one of them."""
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
    voltage = positive(bus_voltage, f"{where}: bus_voltage")
    return ActuatorLaw(bus_voltage=frozen_array(np.full(len(joints), voltage)), **columns)
