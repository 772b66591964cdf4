"""One row of numbers for all stages, each stage's numbers after those of the stage before.

Stages differ in size; what belongs to them lies in such rows, so that functions evaluated at consecutive stages read and write
one piece of memory. Which stage has which numbers is declared once, by their counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from aerial_model.numerics.jit import compiled


class Ragged(NamedTuple):
    """Numbers of n parts, one part after the other."""

    values: np.ndarray  # (starts[n], …)
    starts: np.ndarray  # (n + 1,) where each part begins, and where the last one ends

    @staticmethod
    def zeros(counts: Sequence[int] | np.ndarray) -> Ragged:
        """Return n parts of so many zeros each ``(n,)``."""
        starts = starts_of(counts)
        return Ragged(np.zeros(starts[-1]), starts)

    @staticmethod
    def joined(parts: Sequence[np.ndarray]) -> Ragged:
        """Return parts that are given one by one ``(·, …)``."""
        return Ragged(np.concatenate(parts), starts_of([len(part) for part in parts]))

    def span(self, first: int, end: int) -> np.ndarray:
        """Return the numbers of parts ``first`` to ``end``, the latter not included, in shared memory."""
        return self.values[self.starts[first] : self.starts[end]]


def starts_of(counts: Sequence[int] | np.ndarray) -> np.ndarray:
    """Return where each of n parts of so many numbers begins, and where the last one ends ``(n + 1,)``."""
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


@compiled
def part(ragged: Ragged, k: int) -> np.ndarray:
    """Return the numbers of part ``k`` in shared memory; for compiled code, which knows no methods."""
    return ragged.values[ragged.starts[k] : ragged.starts[k + 1]]


@compiled
def to_rows(values: np.ndarray, starts: np.ndarray, rows: np.ndarray, factor: float) -> None:
    """Write the parts of ``values`` ``(starts[n],)``, times ``factor``, into the rows of a matrix ``(n, ·)``."""
    for k in range(len(starts) - 1):
        for i in range(starts[k + 1] - starts[k]):
            rows[k, i] = factor * values[starts[k] + i]


@compiled
def from_rows(rows: np.ndarray, starts: np.ndarray, values: np.ndarray) -> None:
    """Write the rows of a matrix ``(n, ·)`` into the parts of ``values`` ``(starts[n],)``."""
    for k in range(len(starts) - 1):
        for i in range(starts[k + 1] - starts[k]):
            values[starts[k] + i] = rows[k, i]
