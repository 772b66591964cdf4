"""Configuration as data: YAML mappings become frozen dataclasses or named tuples.

A misspelt key is an error that lists the known ones.
"""

from __future__ import annotations

import dataclasses
import difflib
import types
from collections.abc import Iterable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
import yaml

from aerial_model.errors import ConfigurationError

T = TypeVar("T")


def load_yaml(path: Path) -> dict[str, Any]:
    """Return the mapping a YAML file holds.

    Raises:
        ConfigurationError: if the file is missing, is no YAML, or holds anything but a mapping.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read ({error.strerror})") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path}: not valid YAML ({' '.join(str(error).split())})") from None
    if not isinstance(content, dict):
        raise ConfigurationError(f"{path}: expected a mapping of keys to values, found {type(content).__name__}")
    return content


def merged(base: Mapping[str, Any], top: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``base`` with what ``top`` says in its place, mapping by mapping."""
    result = dict(base)
    for key, value in top.items():
        both = isinstance(value, Mapping) and isinstance(result.get(key), Mapping)
        result[key] = merged(result[key], value) if both else value
    return result


def closest(name: str, known: Iterable[str]) -> str:
    """Return ``" (did you mean 'x'?)"`` for the known name nearest to ``name``, or an empty string."""
    matches = difflib.get_close_matches(name, list(known), n=1)
    return f" (did you mean '{matches[0]}'?)" if matches else ""


def check_keys(mapping: Mapping[str, Any], required: Iterable[str], optional: Iterable[str], where: str) -> None:
    """Check that ``mapping`` has all required keys and no unknown one.

    Raises:
        ConfigurationError: naming the key, the place and the keys that are known there.
    """
    required, optional = list(required), list(optional)
    known = required + optional
    for key in mapping:
        if key not in known:
            raise ConfigurationError(
                f"{where}: unknown key '{key}'{closest(str(key), known)}; known: {', '.join(known)}"
            )
    for key in required:
        if key not in mapping:
            raise ConfigurationError(f"{where}: key '{key}' is missing; required: {', '.join(required)}")


def from_mapping(cls: type[T], mapping: Any, where: str) -> T:
    """Build a (nested) frozen dataclass or named tuple from a YAML mapping.

    Fields without a default are required. Numbers become ``float``/``int``, lists of numbers become read-only arrays,
    names become members of a ``StrEnum``, mappings become the class the field is annotated with.

    Args:
        cls: the dataclass or named tuple.
        mapping: what the YAML holds for it.
        where: file and key path, for error messages.

    Raises:
        ConfigurationError: for a missing or unknown key or a value of the wrong kind.
    """
    if not isinstance(mapping, Mapping):
        raise ConfigurationError(f"{where}: expected a mapping, found {mapping!r}")
    required, optional = _fields(cls)
    check_keys(mapping, required, optional, where)
    hints = get_type_hints(cls)
    try:
        return cls(**{key: _convert(hints[key], value, f"{where}: {key}") for key, value in mapping.items()})
    except ValueError as error:
        raise ConfigurationError(f"{where}: {error}") from None


def _fields(cls: Any) -> tuple[list[str], list[str]]:
    """Return the names of the fields without and with a default."""
    if not dataclasses.is_dataclass(cls):
        return [name for name in cls._fields if name not in cls._field_defaults], list(cls._field_defaults)
    fields = [field for field in dataclasses.fields(cls) if field.init]
    missing = dataclasses.MISSING
    optional = [f.name for f in fields if f.default is not missing or f.default_factory is not missing]
    return [field.name for field in fields if field.name not in optional], optional


def _convert(kind: Any, value: Any, where: str) -> Any:
    if isinstance(kind, types.UnionType):  # X | None
        if value is None:
            return None
        kind = next(member for member in get_args(kind) if member is not types.NoneType)
    if isinstance(kind, type) and (dataclasses.is_dataclass(kind) or hasattr(kind, "_fields")):
        return from_mapping(kind, value, where)
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        return _choice(kind, value, where)
    if kind is np.ndarray:
        return frozen_array(value, where)
    if get_origin(kind) is tuple:
        return _converted_tuple(get_args(kind), value, where)
    if kind in (int, float):
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
            raise ConfigurationError(f"{where}: expected a finite number, found {value!r}")
        if kind is int and value != int(value):
            raise ConfigurationError(f"{where}: expected a whole number, found {value!r}")
        return kind(value)
    if kind in (str, bool) and not isinstance(value, kind):
        raise ConfigurationError(f"{where}: expected {kind.__name__}, found {value!r}")
    return tuple(value) if isinstance(value, list) else value


def _choice(kind: type[StrEnum], value: Any, where: str) -> StrEnum:
    """Return the member of that name."""
    known = [str(member) for member in kind]
    if value not in known:
        raise ConfigurationError(f"{where}: no '{value}'{closest(str(value), known)}; there are {', '.join(known)}")
    return kind(value)


def _converted_tuple(kinds: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
    """Return a list as the tuple a field is annotated with: ``tuple[T, ...]``, or of as many kinds as it has items."""
    if not isinstance(value, list):
        raise ConfigurationError(f"{where}: expected a list, found {value!r}")
    if kinds[-1] is Ellipsis:
        kinds = kinds[:1] * len(value)
    if len(value) != len(kinds):
        raise ConfigurationError(f"{where}: expected {len(kinds)} values, found {len(value)}")
    return tuple(_convert(kind, item, f"{where}[{i}]") for i, (kind, item) in enumerate(zip(kinds, value, strict=True)))


def frozen_array(value: Any, where: str = "array", shape: tuple[int, ...] | None = None) -> np.ndarray:
    """Return ``value`` as a read-only float array, checked to be finite and, if given, of ``shape``.

    Raises:
        ConfigurationError: if it is no array of finite numbers or has another shape.
    """
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ConfigurationError(f"{where}: expected numbers, found {value!r}") from None
    if not np.all(np.isfinite(array)):
        raise ConfigurationError(f"{where}: expected finite numbers, found {value!r}")
    if shape is not None and array.shape != shape:
        raise ConfigurationError(f"{where}: expected shape {shape}, found {array.shape}")
    array.flags.writeable = False
    return array


def positive(value: Any, where: str) -> float:
    """Return ``value`` as a float.

    Raises:
        ConfigurationError: if it is no positive number.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not value > 0:
        raise ConfigurationError(f"{where}: expected a positive number, found {value!r}")
    return float(value)
