"""CasADi functions evaluated for many points at once in NumPy's memory.

A call that takes and returns matrices copies each entry several times, through types of CasADi's own: for small functions
that takes longer than what they compute.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple, Protocol

import casadi as ca
import numpy as np


class Pointwise(Protocol):
    """A function that is evaluated for n points at once, in NumPy's memory."""

    def nonzeros(self, i: int) -> np.ndarray:
        """Return row and column of each nonzero of result ``i``, ``(nnz, 2)``."""

    def bind(self, n: int, arguments: Sequence[np.ndarray], results: Sequence[np.ndarray]) -> Callable[[], object]:
        """Return what evaluates it.

        Args:
            n: number of points.
            arguments: one row of numbers each, the nonzeros of all points one after another.
            results: as ``arguments``.

        Raises:
            ValueError: if a row has not as many numbers as the function has nonzeros.
        """


class Interpreted:
    """A function as CasADi evaluates it."""

    def __init__(self, function: ca.Function) -> None:
        self._function = function

    def nonzeros(self, i: int) -> np.ndarray:
        """See ``Pointwise``."""
        pattern = self._function.sparsity_out(i)
        return np.column_stack([pattern.row(), pattern.get_col()]).astype(np.int64).reshape(-1, 2)

    def bind(self, n: int, arguments: Sequence[np.ndarray], results: Sequence[np.ndarray]) -> Callable[[], object]:
        """See ``Pointwise``."""
        mapped = self._function.map(n)
        buffer, evaluate = mapped.buffer()
        name, f = self._function.name(), mapped
        check_sizes(name, arguments, [f.nnz_in(i) for i in range(f.n_in())])
        check_sizes(name, results, [f.nnz_out(i) for i in range(f.n_out())])
        for rows, bind in ((arguments, buffer.set_arg), (results, buffer.set_res)):
            for i, row in enumerate(rows):
                if row.size > 0:
                    bind(i, memoryview(row.reshape(-1)))

        def run(_: tuple = (mapped, buffer, arguments, results)) -> None:  # which nothing else keeps
            evaluate()

        return run


class Memory(NamedTuple):
    """What a function reads and writes for a number of points; the rows have the points one after another."""

    arguments: list[np.ndarray]
    results: list[np.ndarray]
    evaluate: Callable[[], object]


class Batch:
    """A function evaluated for however many points there are: rows in, rows out.

    Args:
        function: of dense columns.
        machine_code: returns that of a function, None if there is none.
    """

    def __init__(self, function: ca.Function, machine_code: Callable[[ca.Function], Pointwise | None]) -> None:
        arguments = function.sx_in()
        results = [ca.densify(ca.vec(result)) for result in function.call(arguments)]
        self.function = ca.Function(function.name(), arguments, results, {"cse": True})
        self._machine_code = machine_code
        self._memory: dict[int, Memory] = {}  # by the number of points

    def __call__(self, *arguments: np.ndarray) -> list[np.ndarray]:
        """Return each result ``(K, ·)``, matrices column by column, for arguments ``(K, ·)``."""
        K = len(arguments[0])
        memory = self.memory(K)
        for row, argument in zip(memory.arguments, arguments, strict=True):
            row[:] = argument.reshape(-1)
        memory.evaluate()
        return [result.reshape(K, -1).copy() for result in memory.results]

    def renew(self) -> None:
        """Look for machine code again."""
        self._memory.clear()
        self.__dict__.pop("_pointwise", None)

    @cached_property
    def _pointwise(self) -> Pointwise:
        return self._machine_code(self.function) or Interpreted(self.function)

    def memory(self, n: int) -> Memory:
        """Return the memory for n points, which is always the same."""
        if n not in self._memory:
            f = self.function
            arguments = [np.zeros(n * f.nnz_in(i)) for i in range(f.n_in())]
            results = [np.zeros(n * f.nnz_out(i)) for i in range(f.n_out())]
            self._memory[n] = Memory(arguments, results, self._pointwise.bind(n, arguments, results))
        return self._memory[n]


def no_machine_code(function: ca.Function) -> None:
    """Have no machine code for any function."""


def check_sizes(name: str, rows: Sequence[np.ndarray], sizes: Sequence[int]) -> None:
    """Raise ValueError unless the rows of a function have as many numbers as it needs."""
    found = [row.size for row in rows]
    if found != list(sizes):
        raise ValueError(f"{name}: expected rows of {list(sizes)} numbers, found {found}")
