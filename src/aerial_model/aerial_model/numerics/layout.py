"""Many arrays in one block of memory, so that compiled code is handed one array in place of all of them.

To hand an array to compiled code takes 0.1 µs, twice as much on the cold caches of a real loop, whatever its size; a tick
had some two hundred to hand over. A structure whose arrays lie in one block begins with its sizes and is cut out of it on either
side by the same function, such as ``kinematics.configuration_in``; both see the same memory.
"""

from __future__ import annotations

import numpy as np

from aerial_model.numerics.jit import compiled


@compiled
def cut(block: np.ndarray, at: int, size: int) -> tuple[np.ndarray, int]:
    """Return the ``size`` numbers of a block from ``at`` on, and where they end."""
    end = at + size
    return block[at:end], end


@compiled
def cut_rows(block: np.ndarray, at: int, rows: int, columns: int) -> tuple[np.ndarray, int]:
    """Return the matrix that lies in a block from ``at`` on, row by row, and where it ends."""
    end = at + rows * columns
    return block[at:end].reshape((rows, columns)), end


@compiled
def cut_flags(block: np.ndarray, at: int, size: int) -> tuple[np.ndarray, int]:
    """Return ``size`` truth values that lie in a block from ``at`` on, a byte each, and where the next number begins."""
    end = at + flags_size(size)
    return block[at:end].view(np.bool_)[:size], end


@compiled
def flags_size(size: int) -> int:
    """Return how many numbers of a block ``size`` truth values take."""
    return (size + 7) // 8
