"""Plans on disk: one NumPy ``.npz`` archive without pickled objects, readable wherever NumPy is.

Format 1: one entry per field of ``Plan`` under the field's name; the terrain as ``terrain_centre`` and ``terrain_size``
``(b, 3)`` and ``terrain_yaw`` ``(b,)`` of its b boxes; and the entry ``format``. ``model_hash`` tells for which robot
folder the plan was made.
"""

from __future__ import annotations

import dataclasses
import zipfile
from pathlib import Path

import numpy as np

from aerial_model.errors import ConfigurationError, InvalidPlanError
from aerial_model.plan import Plan
from aerial_model.robot import Robot
from aerial_model.terrain import Box, Terrain

FORMAT = 1
_FIELDS = tuple(field.name for field in dataclasses.fields(Plan) if field.name != "terrain")


def save_plan(plan: Plan, path: Path) -> None:
    """Write ``plan`` to ``path``.

    Raises:
        ConfigurationError: if the file cannot be written.
    """
    boxes = plan.terrain.boxes
    entries = {
        "format": FORMAT,
        **{name: getattr(plan, name) for name in _FIELDS},
        "terrain_centre": np.array([box.centre for box in boxes]).reshape(-1, 3),
        "terrain_size": np.array([box.size for box in boxes]).reshape(-1, 3),
        "terrain_yaw": np.array([box.yaw for box in boxes]),
    }
    try:
        with path.open("wb") as file:  # given a name, NumPy would append to it
            np.savez_compressed(file, **entries)
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be written ({error.strerror})") from None


def load_plan(path: Path, robot: Robot) -> Plan:
    """Return the plan in ``path``, checked to be consistent, finite and made for ``robot``.

    Raises:
        InvalidPlanError: if it is not, or the file is no plan of this format.
    """
    try:
        with np.load(path, allow_pickle=False) as entries:
            if int(entries["format"]) != FORMAT:
                raise InvalidPlanError(f"{path}: plan file of format {entries['format']}; this version reads {FORMAT}")
            fields = {name: _value(entries[name]) for name in _FIELDS}
            rows = zip(entries["terrain_centre"], entries["terrain_size"], entries["terrain_yaw"], strict=True)
            terrain = Terrain(boxes=tuple(Box(centre=centre, size=size, yaw=float(yaw)) for centre, size, yaw in rows))
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, ConfigurationError) as error:
        raise InvalidPlanError(f"{path}: not a plan file ({error})") from None
    return Plan(**fields, terrain=terrain).checked(robot)


def _value(entry: np.ndarray) -> object:
    return entry if entry.ndim else entry.item()
