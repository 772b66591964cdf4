"""Stage functions compiled to machine code, on disk: ten times faster to evaluate, and no derivatives to make.

A file's name has the hash of the expressions it was made from, so that a function is found again exactly as long as it is
the same: whatever it depends on, robot, weights or formulation. It also has that of the processor, whose every instruction
may be used. Where a function is not compiled, the interpreted one is used. Compiling takes a C compiler and some seconds
a stage kind, and is asked for, never done behind one's back.
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

import casadi as ca
import numpy as np

from aerial_model.errors import AerialError
from aerial_planner.codegen import c_source
from aerial_planner.codegen.batch import check_sizes
from aerial_planner.ocp import stage
from aerial_planner.ocp.stage import StageEvaluation, StageKind

# Products and sums stay apart, as they are interpreted: both forms give the same numbers to the last bit.
_FLAGS = ("-O1", "-march=native", "-ffp-contract=off", "-fPIC", "-shared")


class CompilationError(AerialError):
    """The C compiler is missing or failed."""


def default_cache() -> Path:
    """Return the folder for compiled functions: ``$XDG_CACHE_HOME`` or ``~/.cache``, ``aerial``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "aerial"


class CompiledFunction:
    """A function of a shared library that ``c_source`` wrote; see ``Pointwise``.

    Args:
        library: that has it.
        name: of the function there.
        n_results: how many it has.
    """

    def __init__(self, library: ctypes.CDLL, name: str, n_results: int) -> None:
        self._function = getattr(library, name)
        self._function.argtypes = [ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
        self._function.restype = None
        address = ctypes.addressof(ctypes.c_int.in_dll(library, f"{name}_inputs"))
        (n_arguments,) = (ctypes.c_int * 1).from_address(address)
        self._inputs = list((ctypes.c_int * n_arguments).from_address(address + ctypes.sizeof(ctypes.c_int)))
        address = ctypes.addressof(ctypes.c_int.in_dll(library, f"{name}_nonzeros"))
        self._nonzeros: list[np.ndarray] = []
        for _ in range(n_results):
            (count,) = (ctypes.c_int * 1).from_address(address)
            pairs = (ctypes.c_int * (2 * count)).from_address(address + ctypes.sizeof(ctypes.c_int))
            self._nonzeros.append(np.array(pairs, dtype=np.int64).reshape(count, 2))
            address += (1 + 2 * count) * ctypes.sizeof(ctypes.c_int)

    def nonzeros(self, i: int) -> np.ndarray:
        """See ``Pointwise``."""
        return self._nonzeros[i].copy()

    def bind(self, n: int, arguments: Sequence[np.ndarray], results: Sequence[np.ndarray]) -> Callable[[], object]:
        """See ``Pointwise``."""
        rows = [*arguments, *results]
        if not all(row.flags.c_contiguous and row.dtype == np.float64 for row in rows):
            raise ValueError("expected rows of float64, one number after the other")
        check_sizes(self._function.__name__, arguments, [n * size for size in self._inputs])
        check_sizes(self._function.__name__, results, [n * len(at) for at in self._nonzeros])
        takes, gives = (
            (ctypes.c_void_p * len(part))(*(row.ctypes.data for row in part)) for part in (arguments, results)
        )
        function = self._function

        def evaluate(_: list[np.ndarray] = rows) -> None:  # which keeps the memory
            function(n, takes, gives)

        return evaluate


class FunctionLibrary:
    """The compiled functions of all robots.

    Args:
        folder: that holds them.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def load(self, kind: StageKind) -> StageEvaluation | None:
        """Return the compiled functions of a stage kind, None if there are none."""
        file = self._file(kind.name, _expressions(kind))
        if not file.is_file():
            return None
        library = ctypes.CDLL(str(file))
        return StageEvaluation(
            values=CompiledFunction(library, f"{kind.name}_values", 3),
            derivatives=CompiledFunction(library, f"{kind.name}_derivatives", 5),
        )

    def has(self, kind: StageKind) -> bool:
        """Return whether a stage kind is compiled."""
        return self._file(kind.name, _expressions(kind)).is_file()

    def load_function(self, function: ca.Function) -> CompiledFunction | None:
        """Return a compiled function, None if there is none."""
        file = self._file(function.name(), function)
        return CompiledFunction(ctypes.CDLL(str(file)), function.name(), function.n_out()) if file.is_file() else None

    def compile(self, kind: StageKind) -> bool:
        """Compile a stage kind, unless it is there; return whether it had to be.

        Raises:
            CompilationError: if there is no C compiler, or it fails.
        """
        return self._compile(self._file(kind.name, _expressions(kind)), kind.together)

    def compile_function(self, function: ca.Function) -> bool:
        """Compile a function; as ``compile``."""
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

    def _file(self, name: str, expressions: ca.Function) -> Path:
        """Return the file of what has these expressions, by their hash and that of how they become machine code."""
        digest = hashlib.sha256(
            "\n".join([expressions.serialize(), ca.__version__, platform.machine(), *_FLAGS]).encode()
        )
        for module in (stage, c_source):
            digest.update(Path(module.__file__).read_bytes())
        digest.update(_processor().encode())
        return self.folder / f"{name}-{digest.hexdigest()[:16]}.so"


def _expressions(kind: StageKind) -> ca.Function:
    outputs = [kind.cost, kind.constraints, kind.y_is, *([] if kind.next_state is None else [kind.next_state])]
    return ca.Function(kind.name, [kind.x, kind.u, kind.p, kind.y], outputs)


@cache
def _processor() -> str:
    """Return what tells processors with different instructions apart, as far as the system says."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    return next((line for line in lines if line.startswith(("flags", "Features"))), platform.processor())
