"""Vectors of an optimal control problem declared as named entries: one declaration cuts symbols and packs numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from aerial_model.config import closest

Shape = tuple[int, ...]
Value = TypeVar("Value")


class VectorLayout:
    """An ordered list of named entries that lie one after another in a vector, matrices column by column.

    Args:
        what: the vector's name in error messages.
        entries: name → shape, in the order of memory: ``()`` a scalar, ``(n,)`` a column, ``(m, n)`` a matrix.
    """

    def __init__(self, what: str, **entries: Shape) -> None:
        self.what = what
        self.entries: Mapping[str, Shape] = entries

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Where each entry lies in the vector."""
        ends = np.cumsum([0, *(int(np.prod(shape)) for shape in self.entries.values())]).tolist()
        return {name: slice(*span) for name, span in zip(self.entries, pairwise(ends), strict=True)}

    @cached_property
    def size(self) -> int:
        """Length of the vector."""
        return sum(int(np.prod(shape)) for shape in self.entries.values())

    def symbols(self) -> dict[str, ca.SX]:
        """Return a new CasADi symbol of each entry."""
        return {name: ca.SX.sym(name, *_rows_and_columns(shape)) for name, shape in self.entries.items()}

    def join(self, **expressions: ca.SX) -> ca.SX:
        """Return the vector ``(size,)`` of CasADi expressions, one of each entry.

        Raises:
            ValueError: if an entry is missing, unknown or misshapen.
        """
        self._check_names(expressions)
        for name, shape in self.entries.items():
            if expressions[name].shape != _rows_and_columns(shape):
                raise self._misshapen(name, expressions[name].shape)
        return ca.vertcat(ca.SX(0, 1), *(ca.vec(expressions[name]) for name in self.entries))

    def pack(self, **values: ArrayLike) -> np.ndarray:
        """Return the vector ``(..., size)`` of numbers, one of each entry; leading axes are broadcast.

        Raises:
            ValueError: if an entry is missing, unknown or misshapen.
        """
        self._check_names(values)
        return self._packed({name: np.asarray(value, dtype=float) for name, value in values.items()})

    def filled(self, value: float, **values: ArrayLike) -> np.ndarray:
        """Return the vector ``(..., size)`` with ``value`` in the entries that are not named, as bounds have infinity.

        Raises:
            ValueError: if an entry is unknown or misshapen.
        """
        self._check_known(values)
        others = {name: np.full(shape, value) for name, shape in self.entries.items() if name not in values}
        return self._packed(others | {name: np.asarray(value, dtype=float) for name, value in values.items()})

    def unpack(self, vector: ArrayLike) -> dict[str, np.ndarray]:
        """Return each entry ``(..., *shape)`` of vectors ``(..., size)``: the inverse of ``pack``.

        Raises:
            ValueError: if the vectors are not of this size.
        """
        vector = np.asarray(vector, dtype=float)
        if vector.shape[-1:] != (self.size,):
            raise ValueError(f"{self.what}: expected {self.size} numbers, found shape {vector.shape}")
        entries = {}
        for name, shape in self.entries.items():
            entry = vector[..., self.slices[name]].reshape((*vector.shape[:-1], *reversed(shape)))
            entries[name] = entry.swapaxes(-1, -2) if len(shape) == 2 else entry
        return entries

    def _packed(self, values: Mapping[str, np.ndarray]) -> np.ndarray:
        leading = {}
        for name, shape in self.entries.items():
            axes = values[name].ndim - len(shape)
            if axes < 0 or values[name].shape[axes:] != shape:
                raise self._misshapen(name, values[name].shape)
            leading[name] = values[name].shape[:axes]
        packed = np.empty((*np.broadcast_shapes(*leading.values()), self.size))
        for name, shape in self.entries.items():
            columns = values[name].swapaxes(-1, -2) if len(shape) == 2 else values[name]
            packed[..., self.slices[name]] = columns.reshape(*leading[name], -1 if columns.size else 0)
        return packed

    def _check_names(self, values: Mapping[str, object]) -> None:
        self._check_known(values)
        missing = [name for name in self.entries if name not in values]
        if missing:
            raise ValueError(f"{self.what}: expected {', '.join(self.entries)}, missing {', '.join(missing)}")

    def _check_known(self, values: Mapping[str, object]) -> None:
        for name in values:
            if name not in self.entries:
                known = ", ".join(self.entries) or "none"
                raise ValueError(f"{self.what}: unknown entry '{name}'{closest(name, self.entries)}; known: {known}")

    def _misshapen(self, name: str, found: Shape) -> ValueError:
        return ValueError(f"{self.what}: expected {name} of shape {self.entries[name]}, found {found}")


@dataclass(frozen=True, kw_only=True)
class StageLayout:
    """State, control and parameters of a stage kind, no two entries of one name.

    Raises:
        ValueError: if two entries have the same name.
    """

    state: VectorLayout
    control: VectorLayout
    parameters: VectorLayout

    def __post_init__(self) -> None:
        names = [name for part in (self.state, self.control, self.parameters) for name in part.entries]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{self.state.what}: expected names of one entry each, found twice: {', '.join(twice)}")


class StageSymbols:
    """CasADi symbols of a stage kind: each entry an attribute of its name, the three vectors as ``x``, ``u`` and ``p``."""

    def __init__(self, layout: StageLayout) -> None:
        parts = [part.symbols() for part in (layout.state, layout.control, layout.parameters)]
        self.layout = layout
        self.x, self.u, self.p = (
            layout.state.join(**parts[0]),
            layout.control.join(**parts[1]),
            layout.parameters.join(**parts[2]),
        )
        self._entries = parts[0] | parts[1] | parts[2]

    def __getattr__(self, name: str) -> ca.SX:
        entries: dict[str, ca.SX] = self.__dict__.get("_entries", {})
        if name not in entries:
            raise AttributeError(f"no entry '{name}'{closest(name, entries)}; known: {', '.join(entries)}")
        return entries[name]


def _rows_and_columns(shape: Shape) -> tuple[int, int]:
    """Return CasADi's shape of an entry: scalars and columns are matrices of one column."""
    rows, columns = (*shape, 1, 1)[:2]
    return rows, columns
