"""Declared memory layouts: many arrays in one block, so that compiled code is handed one array in place of all of them.

To hand an array to compiled code takes 0.1 µs, twice as much on the cold caches of a real loop, whatever its size; a tick
had some two hundred to hand over. A structure whose arrays lie in one block is read out of it on either side by the same
function, such as ``kinematics.configuration_in``; both see the same memory. Which array lies where is said once::

    LAYOUT = Layout(sizes=("n",), numbers=("gain",), arrays={"position": ("n",), "stiffness": ("n", "n")})

    class Spring(NamedTuple):
        gain: float
        position: np.ndarray
        stiffness: np.ndarray
        block: np.ndarray

    spring_in = LAYOUT.reader(Spring)  # compiled: spring_in(block) gives the arrays in a block
    spring = spring_in(LAYOUT.block(n=3, gain=2.0))
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass
from math import prod
from typing import Any, TypeVar, get_type_hints

import numpy as np

from aerial_model.numerics.jit import compiled

S = TypeVar("S", bound=tuple)
Dimension = int | str  # a whole number, or a formula of the sizes: 3, "n", "6 + n"

_BYTES = 8  # of a number of a block


@dataclass(frozen=True, kw_only=True)
class Layout:
    """What lies in a block, in this order: sizes and numbers, one entry each, then the arrays, row by row.

    Names of what belongs to a structure within the structure are dotted: ``body.com``.
    """

    sizes: tuple[str, ...]  # whole numbers that the dimensions are formulas of
    numbers: tuple[str, ...] = ()
    arrays: Mapping[str, tuple[Dimension, ...]]  # name → shape
    flags: Set[str] = frozenset()  # vectors among the arrays that hold truth values, a byte each
    kind: type[float] | type[int] = float  # of the numbers in the block

    def size(self, **sizes: int) -> int:
        """Return how many numbers a block takes whose arrays have these sizes."""
        return self._header + sum(self._length(name, sizes) for name in self.arrays)

    def block(self, **header: float) -> np.ndarray:
        """Return a block whose arrays hold zeros, given every size and number by its name, dots written as ``__``."""
        known = [name.replace(".", "__") for name in (*self.sizes, *self.numbers)]
        if set(header) != set(known):
            raise TypeError(f"a block of this layout is made from {', '.join(known)}, found {', '.join(header)}")
        block = np.zeros(self.size(**{name: int(header[name]) for name in self.sizes}), dtype=self.kind)
        block[: self._header] = [header[name] for name in known]
        return block

    def reader(self, structure: type[S]) -> Callable[[np.ndarray], S]:
        """Return the compiled function that gives the structure lying in a block, as views of the block's memory.

        Called once, at the top level of the module that declares the layout: the machine code is kept under its name.

        Args:
            structure: a named tuple whose fields are arrays, sizes or numbers of the layout by name, named tuples of such,
                and ``block``, which is the block itself.
        """
        module = sys.modules[structure.__module__]
        name = f"_{structure.__name__.strip('_')}_in"
        constructors: dict[str, type] = {}
        result = self._constructed(structure, "", constructors)
        text = "\n    ".join([f"def {name}(block):", *self._statements(), f"return {result}"])
        scope: dict[str, Any] = {"__name__": structure.__module__, "np": np, **constructors}
        exec(compile(text, str(module.__file__), "exec"), scope)  # as namedtuple does: one declaration, no second list
        function = scope[name]
        function.__doc__ = f"Return the ``{structure.__name__}`` that lies in a block."
        return compiled(function)

    @property
    def _header(self) -> int:
        return len(self.sizes) + len(self.numbers)

    def _length(self, name: str, sizes: Mapping[str, int]) -> int:
        """Return how many numbers of a block an array takes."""
        count = prod(int(eval(str(dimension), {}, dict(sizes))) for dimension in self.arrays[name])
        return -(-count // _BYTES) if name in self.flags else count

    def _statements(self) -> list[str]:
        """Return the statements that cut a block into variables."""
        header = [*(f"int(block[{i}])" for i in range(len(self.sizes)))]
        header += [f"block[{i}]" for i in range(len(self.sizes), self._header)]
        lines = [
            f"{_variable(name)} = {value}" for name, value in zip((*self.sizes, *self.numbers), header, strict=True)
        ]
        lines.append(f"_end = {self._header}")
        for name, shape in self.arrays.items():
            dimensions = [f"({dimension})" for dimension in shape]
            count = " * ".join(dimensions)
            if name in self.flags:
                part = f"block[_at:_end].view(np.bool_)[:{count}]"
                count = f"({count} + {_BYTES - 1}) // {_BYTES}"
            else:
                part = "block[_at:_end]" + (f".reshape(({', '.join(dimensions)}))" if len(shape) > 1 else "")
            lines += ["_at = _end", f"_end = _at + {count}", f"{_variable(name)} = {part}"]
        return lines

    def _constructed(self, structure: type, path: str, constructors: dict[str, type]) -> str:
        """Return the expression that makes a structure of the variables, and note the classes that it names."""
        constructors[structure.__name__] = structure
        known = {*self.sizes, *self.numbers, *self.arrays}
        values = []
        for field, kind in get_type_hints(structure).items():
            name = path + field
            if isinstance(kind, type) and issubclass(kind, tuple):
                values.append(self._constructed(kind, f"{name}.", constructors))
            elif name == "block" or name in known:
                values.append(_variable(name))
            else:
                raise TypeError(f"{structure.__name__}.{field}: the layout has no '{name}'; it has {', '.join(known)}")
        return f"{structure.__name__}({', '.join(values)})"


def _variable(name: str) -> str:
    return name.replace(".", "__")
