"""Stage functions compiled to machine code, on disk: three times faster to evaluate, and no derivatives to make.

A file's name has the hash of the expressions it was made from, so that a function is found again exactly as long as it is
the same: whatever it depends on, robot, weights or formulation. Where a function is not compiled, the interpreted one is
used. Compiling takes a C compiler and some seconds a stage kind, and is asked for, never done behind one's back.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from pathlib import Path

import casadi as ca

from aerial_model.errors import AerialError
from aerial_planner import stage
from aerial_planner.stage import StageFunctions, StageKind

_NAMES = ("values", "gradient", "jacobian", "hessian")
# Two passes of -O1 take time with the square of a function's length and gain nothing on straight-line code.
_FLAGS = ("-O1", "-fno-tree-dominator-opts", "-fno-tree-pre", "-fPIC", "-shared")


class CompilationError(AerialError):
    """The C compiler is missing or failed."""


def default_cache() -> Path:
    """Return the folder for compiled functions: ``$XDG_CACHE_HOME`` or ``~/.cache``, ``aerial``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "aerial"


class FunctionLibrary:
    """The compiled stage kinds of all robots.

    Args:
        folder: that holds them.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def load(self, kind: StageKind) -> StageFunctions | None:
        """Return the compiled functions of a stage kind, None if there are none."""
        file = self._file(kind)
        if not file.is_file():
            return None
        return StageFunctions(**{name: ca.external(f"{kind.name}_{name}", str(file)) for name in _NAMES})

    def compile(self, kind: StageKind) -> bool:
        """Compile a stage kind, unless it is there; return whether it had to be.

        Raises:
            CompilationError: if there is no C compiler, or it fails.
        """
        if self._file(kind).is_file():
            return False
        compiler = shutil.which(os.environ.get("CC", "gcc"))
        if compiler is None:
            raise CompilationError("no C compiler: expected gcc on PATH or its name in CC; plans work without, slower")
        functions = kind.functions()
        self.folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=self.folder) as scratch:
            generator = ca.CodeGenerator("kind.c")
            for name in _NAMES:
                generator.add(getattr(functions, name))
            generator.generate(scratch + os.sep)
            command = [compiler, *_FLAGS, "kind.c", "-o", "kind.so", "-lm"]
            outcome = subprocess.run(command, cwd=scratch, capture_output=True, text=True, check=False)
            if outcome.returncode != 0:
                raise CompilationError(f"{compiler} failed on {kind.name}: {outcome.stderr.strip()[-300:]}")
            os.replace(Path(scratch, "kind.so"), self._file(kind))  # whole or not at all
        return True

    def _file(self, kind: StageKind) -> Path:
        return self.folder / f"{kind.name}-{_fingerprint(kind)}.so"


def _fingerprint(kind: StageKind) -> str:
    """Return the hash of a kind's expressions and of how they become functions and machine code."""
    outputs = [kind.cost, kind.constraints, *([] if kind.next_state is None else [kind.next_state])]
    content = ca.Function(kind.name, [kind.x, kind.u, kind.p], outputs).serialize()
    digest = hashlib.sha256("\n".join([content, ca.__version__, platform.machine(), *_FLAGS]).encode())
    digest.update(Path(stage.__file__).read_bytes())
    return digest.hexdigest()[:16]
