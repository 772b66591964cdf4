"""The programs in examples/ run, keep to the public surface, are short, and are what the README shows."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((TOP / "examples").glob("*.py"))
SURFACES = {"aerial_model", "aerial_planner", "aerial_planner.ocp", "aerial_wbic", "aerial_sim", "aerial_evaluation"}
LINES_MAX = 30
SAID = {
    "fly_a_flip": ["landed"],
    "own_motion": ["twist: ", "90° to the left"],
    "plan_a_jump": ["planned in ", "touchdown after", "three metres: "],
}


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(example, tmp_path):
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    done = subprocess.run([sys.executable, example], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert all(words in done.stdout for words in SAID[example.stem]), done.stdout


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_uses_the_public_surface_alone(example):
    tree = ast.parse(example.read_text())
    ours = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and "aerial" in node.module}
    assert ours <= SURFACES
    assert len(example.read_text().splitlines()) < LINES_MAX


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_the_readme_shows_an_example_as_it_is(example):
    assert f"```python\n{example.read_text()}```" in (TOP / "README.md").read_text()
