"""Linter, formatter, type checker and import contract have nothing to say; what each says is in the failure's message."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]
PYTHON = ("src", "tests", "examples")


def test_the_linter_has_nothing_to_say(tool):
    done = tool("ruff", "check", *PYTHON)
    assert done.returncode == 0, f"`ruff check` says:\n{done.stdout}{done.stderr}"


def test_the_formatter_would_change_nothing(tool):
    done = tool("ruff", "format", "--check", *PYTHON)
    assert done.returncode == 0, f"`ruff format` would change:\n{done.stdout}{done.stderr}"


def test_the_type_checker_passes(tool):
    done = tool("mypy")
    assert done.returncode == 0, f"`mypy` says:\n{done.stdout}{done.stderr}"


def test_the_import_contract_is_kept(tool):
    done = tool("lint-imports", "--no-cache")
    assert done.returncode == 0, f"`lint-imports` says:\n{done.stdout}{done.stderr}"


@pytest.mark.parametrize(
    ("importer", "line", "contract"),
    [
        ("aerial_wbic/controller.py", "import aerial_planner.planner", "do not know of each other"),
        ("aerial_model/errors.py", "import aerial_wbic.gains", "Packages import downwards"),
        ("aerial_sim/simulation.py", "import rclpy", "ROS is known to nodes"),
        ("aerial_planner/ocp/riccati.py", "import aerial_model.robot.robot", "know no robot"),
        ("aerial_model/robot/scale.py", "import aerial_model.values.terrain", "No two rooms"),
    ],
)
def test_the_import_contract_fails_when_it_is_broken(tool, tmp_path, importer, line, contract):
    shutil.copytree(TOP / "src", tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__", "robots", "meshes"))
    shutil.copy(TOP / ".importlinter", tmp_path)
    module = tmp_path / "src" / importer.split("/")[0] / importer
    module.write_text(f"{module.read_text()}\n{line}\n")
    done = tool("lint-imports", "--no-cache", top=tmp_path)
    broken = [text for text in done.stdout.splitlines() if "BROKEN" in text]
    assert done.returncode == 1
    assert any(contract in text for text in broken), done.stdout
