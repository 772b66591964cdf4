"""One row of numbers for all stages, each stage's numbers after those of the stage before.

Stages differ in size; what belongs to them lies in such rows, so that functions evaluated at consecutive stages read and write
one piece of memory. Which stage has which numbers is declared once, by their counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Ragged(NamedTuple):
    """Numbers of n parts, one part after the other."""

    values: np.ndarray  # (starts[n], …)
    starts: np.ndarray  # (n + 1,) where each part begins, and where the last one ends

    @staticmethod
    def zeros(counts: Sequence[int] | np.ndarray) -> Ragged:
        """Return parts of so many zeros each ``(n,)``."""
        starts = starts_of(counts)
        return Ragged(np.zeros(starts[-1]), starts)

    @staticmethod
    def joined(parts: Sequence[np.ndarray]) -> Ragged:
        """Return parts that are given one by one ``(·, …)``."""
        return Ragged(np.concatenate(parts), starts_of([len(part) for part in parts]))

    def span(self, first: int, end: int) -> np.ndarray:
        """Return the numbers of parts ``first`` to ``end``, without the latter, in memory that is shared."""
        return self.values[self.starts[first] : self.starts[end]]


def starts_of(counts: Sequence[int] | np.ndarray) -> np.ndarray:
    """Return where each of n parts of so many numbers begins, and where the last one ends ``(n + 1,)``."""
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
