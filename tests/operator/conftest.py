import json
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from aerial_operator.__main__ import main

TIMEOUT = 120.0  # [s] for a command on a busy machine


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    status: int
    output: str
    errors: str

    @property
    def figures(self) -> dict[str, Any]:
        """The one JSON object on standard output."""
        return json.loads(self.output)


def paths(value, at=""):
    """Every key of a JSON value: a dot leads into an object, ``[]`` into a list."""
    if isinstance(value, dict):
        return {path for key, each in value.items() for path in paths(each, f"{at}.{key}" if at else key)} or {
            f"{at}.{{}}"
        }
    if isinstance(value, list):
        return {path for each in value for path in paths(each, f"{at}[]")} or {f"{at}[]"}
    return {at}


@pytest.fixture(scope="session")
def missing_keys():
    """Return which of the keys that people and scripts rely on a JSON value lacks: ``missing_keys("plan", figures)``."""
    promised = yaml.safe_load((Path(__file__).parent / "json_keys.yaml").read_text(encoding="utf-8"))
    return lambda name, value: sorted(set(promised[name]) - paths(value))


@pytest.fixture(scope="session")
def aerial_process():
    """Run the command line as a process: ``aerial_process("plan", "jump")``."""

    def aerial(*arguments: object) -> Ended:
        command = [sys.executable, "-m", "aerial_operator", *map(str, arguments)]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, check=False)
        return Ended(ended.returncode, ended.stdout, ended.stderr)

    return aerial


@pytest.fixture
def aerial(capfd):
    """Run the command line in this process: ``aerial("plan", "jump")``."""
    handler = signal.getsignal(signal.SIGTERM)

    def aerial(*arguments: object) -> Ended:
        capfd.readouterr()
        try:
            status = main([str(argument) for argument in arguments])
        except SystemExit as end:  # argparse's way
            status = end.code
        return Ended(status, *capfd.readouterr())

    yield aerial
    signal.signal(signal.SIGTERM, handler)
