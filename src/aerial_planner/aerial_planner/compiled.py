"""Stage functions compiled to machine code, on disk: three times faster to evaluate, and no derivatives to make.

A library is valid for one robot, one set of weights and margins, one CasADi and one state of the formulation's source; all
of them are in its fingerprint, and with it in the name of its folder. Where a function is not compiled, the interpreted one is
used. Compiling takes a C compiler and some seconds a stage kind, and is asked for, never done behind one's back.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import casadi as ca

from aerial_model.errors import AerialError
from aerial_planner.stage import StageFunctions, StageKind

if TYPE_CHECKING:
    from aerial_model.robot import Robot
    from aerial_planner.settings import PlannerSettings

_NAMES = ("values", "gradient", "jacobian", "hessian")
# Two passes of -O1 take time with the square of a function's length and gain nothing on straight-line code.
_FLAGS = ("-O1", "-fno-tree-dominator-opts", "-fno-tree-pre", "-fPIC", "-shared")
_SOURCES = ("symbolic.py", "stage.py", "knots.py", "srbm.py", "kino_dynamic.py")  # what the functions are made from
# Settings that reach the functions as parameters and the solver as bounds, with each request.
_GIVEN = {
    "dt",
    "flight_knots",
    "margin",
    "speed_margin",
    "force_max",
    "force_min",
    "swing_clearance",
    "swing_rise_time",
    "landing_lead",
}


class CompilationError(AerialError):
    """The C compiler is missing or failed."""


def default_cache() -> Path:
    """Return the folder for compiled functions: ``$XDG_CACHE_HOME`` or ``~/.cache``, ``aerial``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "aerial"


class FunctionLibrary:
    """The compiled stage kinds of one robot and one set of settings.

    Args:
        cache: folder that holds the libraries of all robots.
        robot: the robot.
        settings: the planner's.
    """

    def __init__(self, cache: Path, robot: Robot, settings: PlannerSettings) -> None:
        self.folder = cache / f"{robot.name}-{_fingerprint(robot, settings)}"

    def load(self, kind: str) -> StageFunctions | None:
        """Return the compiled functions of a stage kind, None if there are none."""
        file = self._file(kind)
        if not file.is_file():
            return None
        return StageFunctions(**{name: ca.external(f"{kind}_{name}", str(file)) for name in _NAMES})

    def compile(self, kind: StageKind) -> bool:
        """Compile a stage kind, unless it is there; return whether it had to be.

        Raises:
            CompilationError: if there is no C compiler, or it fails.
        """
        if self._file(kind.name).is_file():
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
            os.replace(Path(scratch, "kind.so"), self._file(kind.name))  # whole or not at all
        return True

    def _file(self, kind: str) -> Path:
        return self.folder / f"{kind}.so"


def _fingerprint(robot: Robot, settings: PlannerSettings) -> str:
    digest = hashlib.sha256()
    here = Path(__file__).parent
    numbers = {name: value for name, value in asdict(settings).items() if name not in _GIVEN}
    parts = [robot.model_hash, repr(numbers), ca.__version__, platform.machine(), " ".join(_FLAGS)]
    digest.update("\n".join(parts).encode())
    for source in _SOURCES:
        digest.update((here / source).read_bytes())
    return digest.hexdigest()[:16]
