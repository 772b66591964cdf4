"""Plans on disk: one NumPy ``.npz`` archive without pickled objects, readable wherever NumPy is.

Format 2: one entry per field of ``Plan`` under the field's name; the terrain as ``terrain_centre`` and ``terrain_size``
``(b, 3)`` and ``terrain_yaw`` ``(b,)`` of its b boxes; and the entry ``format``. ``model_hash`` tells for which robot
folder the plan was made. Format 1, which is read, too, had no ``ending``: all motions ended in a stand.
"""

from __future__ import annotations

import dataclasses
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from aerial_model.errors import AerialError, ConfigurationError, InvalidPlanError
from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Ending, Plan
from aerial_model.values.terrain import Box, Terrain

FORMAT = 2
READABLE = (1, FORMAT)
_OTHERS = ("terrain", "ending")  # which have entries of another form
_TYPES = {field.name: str(field.type) for field in dataclasses.fields(Plan) if field.name not in _OTHERS}
_KINDS = {"str": "U", "float": "fiu", "np.ndarray": "fiub"}  # NumPy's letters for what an entry of a type may hold


def save_plan(plan: Plan, path: Path) -> None:
    """Write ``plan`` to ``path``.

    Raises:
        ConfigurationError: if the file cannot be written.
    """
    boxes = plan.terrain.boxes
    entries = {
        "format": FORMAT,
        **{name: getattr(plan, name) for name in _TYPES},
        "ending": plan.ending.value,
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
        with path.open("rb") as file, _archive(file) as entries:
            if int(entries["format"]) not in READABLE:
                known = " and ".join(str(number) for number in READABLE)
                raise InvalidPlanError(f"plan file of format {entries['format']}; this version reads {known}")
            ending = Ending.STAND if int(entries["format"]) == 1 else _ending(entries["ending"])
            fields: dict[str, Any] = {name: _value(name, entries[name]) for name in _TYPES}
            rows = zip(entries["terrain_centre"], entries["terrain_size"], entries["terrain_yaw"], strict=True)
            terrain = Terrain(boxes=tuple(Box(centre=centre, size=size, yaw=float(yaw)) for centre, size, yaw in rows))
        return Plan(**fields, terrain=terrain, ending=ending).checked(robot)
    except AerialError as error:
        raise InvalidPlanError(f"{path}: {error}") from None
    except Exception as error:  # of any kind: zipfile, zlib and NumPy do not foresee every damage
        raise InvalidPlanError(
            f"{path}: not a plan file ({' '.join(str(error).split()) or type(error).__name__})"
        ) from None


def _archive(file: BinaryIO) -> np.lib.npyio.NpzFile:
    if not zipfile.is_zipfile(file):
        raise InvalidPlanError("not a plan file (no .npz archive)")
    file.seek(0)
    return np.load(file, allow_pickle=False)


def _ending(entry: np.ndarray) -> Ending:
    try:
        return Ending(entry.item())
    except ValueError:
        raise InvalidPlanError(f"plan field ending: unknown ending '{entry}'; known: {', '.join(Ending)}") from None


def _value(name: str, entry: np.ndarray) -> object:
    kind = _TYPES[name]
    if entry.dtype.kind not in _KINDS[kind] or (entry.ndim > 0) != (kind == "np.ndarray"):
        raise InvalidPlanError(f"plan field {name}: expected {kind}, found {entry.dtype} of shape {entry.shape}")
    return entry if entry.ndim else entry.item()
