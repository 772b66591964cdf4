"""CasADi functions evaluated for many points at once in NumPy's memory.

A call that takes and returns matrices copies each entry several times, through types of CasADi's own: for small functions
that takes longer than what they compute.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np


class InPlace:
    """A function mapped over ``n`` points, and the memory it reads and writes.

    Args:
        function: to be evaluated.
        n: number of points.
        arguments: one row of numbers each, the nonzeros of all points one after another; None: new ones.
        results: as ``arguments``.

    Raises:
        ValueError: if a row has not as many numbers as the function has nonzeros.
    """

    def __init__(
        self,
        function: ca.Function,
        n: int,
        arguments: Sequence[np.ndarray] | None = None,
        results: Sequence[np.ndarray] | None = None,
    ) -> None:
        mapped = function.map(n)
        self._buffer, self._evaluate = mapped.buffer()
        self._function = mapped  # which the buffer does not keep
        sizes_in = [mapped.nnz_in(i) for i in range(mapped.n_in())]
        sizes_out = [mapped.nnz_out(i) for i in range(mapped.n_out())]
        self.arguments = _rows(function, sizes_in, arguments)
        self.results = _rows(function, sizes_out, results)
        for rows, bind in ((self.arguments, self._buffer.set_arg), (self.results, self._buffer.set_res)):
            for i, row in enumerate(rows):
                if row.size > 0:
                    bind(i, memoryview(row))

    @property
    def evaluate(self) -> Callable[[], object]:
        """Call to fill the results from the arguments."""
        return self._evaluate


def _rows(function: ca.Function, sizes: Sequence[int], given: Sequence[np.ndarray] | None) -> list[np.ndarray]:
    if given is None:
        return [np.zeros(size) for size in sizes]
    found = [row.size for row in given]
    if found != list(sizes):
        raise ValueError(f"{function.name()}: expected rows of {list(sizes)} numbers, found {found}")
    return [row.reshape(-1) for row in given]
