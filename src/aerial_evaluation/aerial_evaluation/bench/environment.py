"""Environments of peers: what a benchmark compares with, where it needs versions of libraries that are not ours."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import venv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerial_model.errors import AerialError
from aerial_planner.codegen.library import default_cache


class PeerError(AerialError):
    """A peer's environment is missing, or what runs in it failed."""


@dataclass(frozen=True)
class Peer:
    """A peer, and what its environment holds."""

    name: str
    script: Path  # runs there: JSON on standard input and output
    requirements: tuple[str, ...]  # of pip, the peer itself first
    from_source: tuple[str, ...] = ()  # of pip, built one after another with what is there by then


class Environment:
    """The virtual environment of a peer.

    Args:
        peer: whose.
        folder: where it is, or is to be.
    """

    def __init__(self, peer: Peer, folder: Path | None = None) -> None:
        self.folder = default_cache() / peer.name if folder is None else folder
        self._peer = peer
        self._packages = (*peer.requirements, *peer.from_source)
        self._stamp = self.folder / "made-from"

    @property
    def is_made(self) -> bool:
        """It holds what the peer asks for."""
        return self._stamp.is_file() and self._stamp.read_text(encoding="utf-8").split() == list(self._packages)

    @property
    def missing(self) -> str:
        """What to do when it is not made."""
        return (
            f"{self._peer.name} is not in {self.folder}, where it needs an environment of its own: "
            "`./aerial bench` makes it, once, with --with-peers (up to 1 GB, some minutes)"
        )

    def make(self) -> None:
        """Make it anew.

        Raises:
            PeerError: with the end of pip's output.
        """
        try:
            venv.create(self.folder, clear=True, with_pip=False)
        except OSError as error:
            raise PeerError(f"{self.folder}: cannot be made ({error.strerror})") from None
        install = (sys.executable, "-m", "pip", "--python", str(self._python), "install", "--no-input", "--quiet")
        _run([*install, *self._peer.requirements], "")
        if self._peer.from_source:
            self._build([*install, "--no-build-isolation", "--no-deps", "--force-reinstall", "--no-binary", ":all:"])
        self._stamp.write_text("\n".join(self._packages), encoding="utf-8")

    def _build(self, install: Sequence[str]) -> None:
        (prefix,) = self.folder.glob("lib/python*/site-packages/cmeel.prefix")
        tools = os.pathsep.join([str(self._python.parent), os.environ.get("PATH", "")])
        for package in self._peer.from_source:  # in this order: one may need another
            _run([*install, package], "", {"CMAKE_PREFIX_PATH": str(prefix), "PATH": tools})

    def solve(self, problem: dict[str, Any]) -> dict[str, Any]:
        """Return what the script says about a problem.

        Raises:
            PeerError: if the environment is missing, or the script fails.
        """
        if not self.is_made:
            raise PeerError(self.missing)
        return json.loads(_run([str(self._python), "-I", str(self._peer.script)], json.dumps(problem)))

    @property
    def _python(self) -> Path:
        return self.folder / "bin" / "python"


def _run(command: Sequence[str], text: str, variables: Mapping[str, str] | None = None) -> str:
    """Return what a command prints.

    Raises:
        PeerError: with the end of what it says when it fails.
    """
    ours = {"PYTHONPATH", "LD_LIBRARY_PATH"}  # another Pinocchio's, here
    environment = {name: value for name, value in os.environ.items() if name not in ours} | {"OMP_NUM_THREADS": "1"}
    environment |= variables or {}
    try:
        outcome = subprocess.run(command, input=text, capture_output=True, text=True, env=environment, check=False)
    except OSError as error:
        raise PeerError(f"{command[0]}: cannot be run ({error.strerror})") from None
    if outcome.returncode != 0:
        said = " ".join((outcome.stderr or outcome.stdout).split())[-300:]
        raise PeerError(f"{Path(command[0]).name} ended with status {outcome.returncode}: {said}")
    return outcome.stdout
