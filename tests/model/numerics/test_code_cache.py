"""Machine code is made anew when any source that it was made of has changed, and only then."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from aerial_model.numerics.code_cache import sources

CALLEE = """
from aerial_model.numerics.jit import compiled
FACTOR = {factor}
@compiled
def times(x: float) -> float:
    return {factor} * x
"""
CALLER = """
from aerial_probe_callee import FACTOR, times
from aerial_model.numerics.jit import compiled
@compiled
def twice(x: float) -> float:
    return times(x) + FACTOR * x
"""
CALL = """
from aerial_probe_caller import twice
value = twice(1.0)
print(value, "kept" if twice.stats.cache_hits else "made")
"""


@pytest.fixture
def called(tmp_path):
    """What the caller says in a new process, and whether its machine code was kept: ``called(factor)``."""
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"}
    (tmp_path / "aerial_probe_caller.py").write_text(CALLER)

    def called(factor):
        (tmp_path / "aerial_probe_callee.py").write_text(CALLEE.format(factor=factor))
        done = subprocess.run([sys.executable, "-c", CALL], env=environment, capture_output=True, text=True, check=True)
        return done.stdout.split()

    return called


def test_a_change_of_what_is_built_in_is_noticed(called):
    assert called(2.0) == ["4.0", "made"]
    assert called(2.0) == ["4.0", "kept"]
    assert called(3.0) == ["6.0", "made"]


def test_sources_are_those_that_are_imported_and_no_others():
    import aerial_wbic.behaviours.rest  # noqa: F401  # what is asked about is loaded

    found = sources("aerial_wbic.behaviours.rest")  # some of what it imports stands on lines of its own
    assert {
        "aerial_model.numerics.rotation",
        "aerial_model.values.plan",
        "aerial_wbic.behaviours.rest_trajectory",
    } <= found
    found = sources("aerial_model.kinematics")
    assert {
        "aerial_model.numerics.layout",
        "aerial_model.numerics.jit",
        "aerial_model.numerics.rotation",
        "aerial_model.robot.robot",
    } <= found
    assert not any(name.startswith("aerial_wbic") for name in found)
