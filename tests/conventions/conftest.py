"""What the code is held to before it runs. The folder's name sorts first, so that these tests do."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]


@pytest.fixture
def tool():
    """``tool(name, *arguments, top=...)`` runs a development tool on a tree, this one unless told otherwise."""

    def tool(name: str, *arguments: str, top: Path = TOP) -> subprocess.CompletedProcess[str]:
        packages = [str(setup.parent) for setup in sorted((top / "src").glob("*/setup.py"))]
        path = os.pathsep.join([*packages, os.environ.get("PYTHONPATH", "")])
        return subprocess.run(
            [Path(sys.executable).parent / name, *arguments],
            cwd=top,
            env={**os.environ, "PYTHONPATH": path},
            capture_output=True,
            text=True,
        )

    return tool
