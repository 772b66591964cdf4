"""Functions compiled to machine code, on disk: ten times faster to evaluate, and no derivatives to make.

A file's name has the hash of the expressions its functions were derived from, so that machine code is found again exactly
as long as it is the same, whatever the expressions depend on: robot, weights or formulation. The hash also covers the
sources that derive the functions and write their C, the compiler's flags, and the processor, whose every instruction may be
used. Where a function is not compiled, the interpreted one is used. Compiling takes a C compiler and some seconds a
function, and is asked for, never done unasked.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Protocol

import casadi as ca
import numpy as np

from aerial_model.errors import AerialError
from aerial_planner.codegen import c_source
from aerial_planner.codegen.batch import check_sizes

# Products and sums stay apart, as they are interpreted: both forms give the same numbers to the last bit.
_FLAGS = ("-O1", "-march=native", "-ffp-contract=off", "-fPIC", "-shared")
_INT = ctypes.sizeof(ctypes.c_int)  # [byte]


class CompilationError(AerialError):
    """The C compiler is missing or failed."""


class Derived(Protocol):
    """Functions that take long to derive from their expressions, such as derivatives, and need not be where compiled."""

    @property
    def name(self) -> str:
        """Name of the family of functions; their own names begin with it."""

    @property
    def batch_names(self) -> tuple[str, ...]:
        """Names of ``batch_functions``, in their order."""

    @property
    def derivation(self) -> Path:
        """Source file that derives ``batch_functions`` from ``expressions``."""

    def expressions(self) -> ca.Function:
        """Return all expressions that the functions are derived from, which takes no time."""

    def batch_functions(self) -> Sequence[ca.Function]:
        """Return the functions themselves, which takes long."""


def default_cache() -> Path:
    """Return the folder for compiled functions: ``$XDG_CACHE_HOME`` or ``~/.cache``, ``aerial``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "aerial"


class CompiledFunction:
    """A function of a shared library made of what ``c_source`` wrote; a ``Pointwise``.

    Args:
        library: that has it.
        name: of the function there.
    """

    def __init__(self, library: ctypes.CDLL, name: str) -> None:
        self._function = getattr(library, name)
        self._function.argtypes = [ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
        self._function.restype = None
        inputs, nonzeros = (_Integers(library, f"{name}_{table}") for table in ("inputs", "nonzeros"))
        (n_arguments,), (n_results,) = inputs.read(1), nonzeros.read(1)
        self._inputs = inputs.read(n_arguments)
        self._nonzeros: list[np.ndarray] = []
        for _ in range(n_results):
            (count,) = nonzeros.read(1)
            self._nonzeros.append(np.array(nonzeros.read(2 * count), dtype=np.int64).reshape(count, 2))

    def nonzeros(self, i: int) -> np.ndarray:
        """Return row and column of each nonzero of result ``i``, ``(nnz, 2)``."""
        return self._nonzeros[i].copy()

    def bind(self, n: int, arguments: Sequence[np.ndarray], results: Sequence[np.ndarray]) -> Callable[[], object]:
        """Return what evaluates the function in these rows of memory; see ``Pointwise.bind``."""
        rows = [*arguments, *results]
        if not all(row.flags.c_contiguous and row.dtype == np.float64 for row in rows):
            raise ValueError("expected rows of float64, one number after the other")
        check_sizes(self._function.__name__, arguments, [n * size for size in self._inputs])
        check_sizes(self._function.__name__, results, [n * len(pairs) for pairs in self._nonzeros])
        addresses_in, addresses_out = (
            (ctypes.c_void_p * len(part))(*(row.ctypes.data for row in part)) for part in (arguments, results)
        )
        function = self._function

        def evaluate(_: list[np.ndarray] = rows) -> None:  # whose memory the addresses are of
            function(n, addresses_in, addresses_out)

        return evaluate


class _Integers:
    """A table of C integers in a shared library, read from its beginning to its end."""

    def __init__(self, library: ctypes.CDLL, name: str) -> None:
        self._address = ctypes.addressof(ctypes.c_int.in_dll(library, name))

    def read(self, count: int) -> list[int]:
        """Return the next ``count`` integers."""
        found = list((ctypes.c_int * count).from_address(self._address))
        self._address += count * _INT
        return found


class FunctionLibrary:
    """The compiled functions in a folder, one shared library for each ``Derived`` or single function.

    Args:
        folder: that holds them, made when first needed.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def load(self, derived: Derived) -> list[CompiledFunction] | None:
        """Return the compiled functions of a family, as ``batch_functions`` orders them; None if there are none."""
        file = self._file_of(derived)
        if not file.is_file():
            return None
        library = ctypes.CDLL(str(file))
        return [CompiledFunction(library, name) for name in derived.batch_names]

    def has(self, derived: Derived) -> bool:
        """Return whether a family of functions is compiled."""
        return self._file_of(derived).is_file()

    def load_function(self, function: ca.Function) -> CompiledFunction | None:
        """Return the compiled form of a single function, None if there is none."""
        file = self._file(function.name(), function)
        return CompiledFunction(ctypes.CDLL(str(file)), function.name()) if file.is_file() else None

    def compile(self, derived: Derived) -> bool:
        """Compile a family of functions, unless it is compiled already; return whether it had to be.

        Raises:
            CompilationError: if there is no C compiler, or it fails.
        """
        return self._compile(self._file_of(derived), derived.batch_functions)

    def compile_function(self, function: ca.Function) -> bool:
        """Compile a single function, unless it is compiled already; return whether it had to be.

        Raises:
            CompilationError: if there is no C compiler, or it fails.
        """
        return self._compile(self._file(function.name(), function), lambda: [function])

    def _compile(self, file: Path, functions: Callable[[], Sequence[ca.Function]]) -> bool:
        if file.is_file():
            return False
        compiler = shutil.which(os.environ.get("CC", "gcc"))
        if compiler is None:
            raise CompilationError("no C compiler: expected gcc on PATH or its name in CC; plans work without, slower")
        try:
            code = c_source.source(functions())
        except c_source.UnknownOperationError as error:
            raise CompilationError(str(error)) from None
        self.folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=self.folder) as scratch:
            Path(scratch, "code.c").write_text(code)
            command = [compiler, *_FLAGS, "code.c", "-o", "code.so", "-lm"]
            outcome = subprocess.run(command, cwd=scratch, capture_output=True, text=True, check=False)
            if outcome.returncode != 0:
                raise CompilationError(f"{compiler} failed on {file.stem}: {outcome.stderr.strip()[-300:]}")
            os.replace(Path(scratch, "code.so"), file)  # whole or not at all
        return True

    def _file_of(self, derived: Derived) -> Path:
        return self._file(derived.name, derived.expressions(), derived.derivation)

    def _file(self, name: str, expressions: ca.Function, *derivation: Path) -> Path:
        """Return the file of what has these expressions, by their hash and that of how they become machine code."""
        digest = hashlib.sha256(
            "\n".join([expressions.serialize(), ca.CasadiMeta.version(), platform.machine(), *_FLAGS]).encode()
        )
        for source in (*derivation, Path(c_source.__file__)):
            digest.update(source.read_bytes())
        digest.update(_processor().encode())
        return self.folder / f"{name}-{digest.hexdigest()[:16]}.so"


@cache
def _processor() -> str:
    """Return what tells processors with different instructions apart, as far as the system says."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    return next((line for line in lines if line.startswith(("flags", "Features"))), platform.processor())
