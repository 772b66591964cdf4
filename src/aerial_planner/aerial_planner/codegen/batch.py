"""Batch evaluation: a CasADi function at many points at once, reading and writing NumPy's memory.

A call of CasADi's that takes and returns matrices copies each entry several times, through types of its own: for small
functions that takes longer than what they compute.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple, Protocol

import casadi as ca
import numpy as np


class Pointwise(Protocol):
    """A function that is evaluated at n points at once, in NumPy's memory.

    An argument or a result is one row of float64: its nonzeros at the first point, column by column, then those at the
    second, and so on.
    """

    def nonzeros(self, i: int) -> np.ndarray:
        """Return row and column of each nonzero of result ``i``, ``(nnz, 2)``, in the order they are written."""

    def bind(self, n: int, arguments: Sequence[np.ndarray], results: Sequence[np.ndarray]) -> Callable[[], object]:
        """Return what evaluates the function in these rows of memory, each time it is called.

        Args:
            n: number of points.
            arguments: row of each argument ``(n · nnz,)``, read.
            results: row of each result ``(n · nnz,)``, written.

        Raises:
            ValueError: if a row has not as many numbers as the function has nonzeros at n points.
        """


class Interpreted:
    """A function as CasADi's virtual machine evaluates it; a ``Pointwise`` that is always there.

    Args:
        function: to evaluate.
    """

    def __init__(self, function: ca.Function) -> None:
        self._function = function

    def nonzeros(self, i: int) -> np.ndarray:
        """Return row and column of each nonzero of result ``i``, ``(nnz, 2)``."""
        pattern = self._function.sparsity_out(i)
        return np.column_stack([pattern.row(), pattern.get_col()]).astype(np.int64).reshape(-1, 2)

    def bind(self, n: int, arguments: Sequence[np.ndarray], results: Sequence[np.ndarray]) -> Callable[[], object]:
        """Return what evaluates the function in these rows of memory; see ``Pointwise.bind``."""
        mapped = self._function.map(n)
        buffer, evaluate = mapped.buffer()
        name, f = self._function.name(), mapped
        check_sizes(name, arguments, [f.nnz_in(i) for i in range(f.n_in())])
        check_sizes(name, results, [f.nnz_out(i) for i in range(f.n_out())])
        _bind_rows(arguments, buffer.set_arg)
        _bind_rows(results, buffer.set_res)

        def run(_: object = (mapped, buffer, arguments, results)) -> None:  # CasADi's buffer keeps none of them alive
            evaluate()

        return run


def _bind_rows(rows: Sequence[np.ndarray], bind: Callable[..., object]) -> None:
    """Bind rows of numbers as arguments or results of a CasADi function, which takes no empty ones."""
    for i, row in enumerate(rows):
        if row.size > 0:
            bind(i, row.reshape(-1).data)


class Memory(NamedTuple):
    """What a function reads and writes at n points, and what evaluates it there."""

    arguments: list[np.ndarray]  # (n · nnz,) each
    results: list[np.ndarray]  # (n · nnz,) each
    evaluate: Callable[[], object]


class Batch:
    """A function of dense columns, evaluated at however many points there are: a row a point in and out.

    Args:
        function: to evaluate.
        machine_code: returns the machine code of a function, None if there is none.

    Attributes:
        function: the one given, its results dense columns; what to compile.
    """

    def __init__(self, function: ca.Function, machine_code: Callable[[ca.Function], Pointwise | None]) -> None:
        arguments = function.sx_in()
        results = [ca.densify(ca.vec(result)) for result in function.call(arguments)]
        self.function = ca.Function(function.name(), arguments, results, {"cse": True})
        self._machine_code = machine_code
        self._memory: dict[int, Memory] = {}  # by the number of points

    def __call__(self, *arguments: np.ndarray) -> list[np.ndarray]:
        """Return each result ``(n, ·)``, matrices column by column, for arguments ``(n, ·)``."""
        n = len(arguments[0])
        memory = self.memory(n)
        for row, argument in zip(memory.arguments, arguments, strict=True):
            row[:] = argument.reshape(-1)
        memory.evaluate()
        return [result.reshape(n, -1).copy() for result in memory.results]

    def renew(self) -> None:
        """Look for machine code again at the next evaluation."""
        self._memory.clear()
        self.__dict__.pop("_pointwise", None)

    @cached_property
    def _pointwise(self) -> Pointwise:
        return self._machine_code(self.function) or Interpreted(self.function)

    def memory(self, n: int) -> Memory:
        """Return the memory for n points: made at the first call, the same at later ones."""
        if n not in self._memory:
            f = self.function
            arguments = [np.zeros(n * f.nnz_in(i)) for i in range(f.n_in())]
            results = [np.zeros(n * f.nnz_out(i)) for i in range(f.n_out())]
            self._memory[n] = Memory(arguments, results, self._pointwise.bind(n, arguments, results))
        return self._memory[n]


def no_machine_code(function: ca.Function) -> None:
    """Return None for any function: all are interpreted."""


def check_sizes(name: str, rows: Sequence[np.ndarray], sizes: Sequence[int]) -> None:
    """Raise ValueError unless the rows of a function have as many numbers as it needs.

    Args:
        name: of the function, for the error's sentence.
        rows: of memory.
        sizes: numbers each must have.
    """
    found = [row.size for row in rows]
    if found != list(sizes):
        raise ValueError(f"{name}: expected rows of {list(sizes)} numbers, found {found}")
