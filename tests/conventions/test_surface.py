"""The public surface: what packages offer exists, is documented, and costs nothing until it is asked for."""

from __future__ import annotations

import ast
import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

SOURCES = Path(__file__).resolve().parents[2] / "src"
SURFACES = ["aerial_model", "aerial_planner", "aerial_planner.ocp", "aerial_wbic", "aerial_sim", "aerial_evaluation"]
PACKAGES = sorted(setup.parent.name for setup in SOURCES.glob("*/setup.py"))
PROMISED = {
    "aerial_model": "Robot MotionRequest Plan Measurement Command Estimate Terrain Box StartFrame ContactSequence",
    "aerial_planner": "Planner PlanningResult PlanReport PlannerSettings PlanLibrary",
    "aerial_planner.ocp": "StageKind StageData Problem Solution SolverOptions",
    "aerial_wbic": "Controller ControllerGains ControllerStatus TickTrace",
    "aerial_sim": "Simulation Conditions",
    "aerial_evaluation": "run Run judge Landing Campaign",
}


def imported_for_type_checkers(surface):
    """Names that a package's ``__init__.py`` imports, also where only a type checker sees it."""
    file = SOURCES / surface.split(".")[0] / surface.replace(".", "/") / "__init__.py"
    nodes = ast.walk(ast.parse(file.read_text()))
    imports = [node for node in nodes if isinstance(node, ast.ImportFrom)]
    return {alias.name for node in imports for alias in node.names} - {"TYPE_CHECKING", "reexport"}


@pytest.mark.parametrize("surface", SURFACES)
def test_a_surface_keeps_its_promises(surface):
    assert set(PROMISED[surface].split()) <= set(importlib.import_module(surface).__all__)


@pytest.mark.parametrize("surface", SURFACES)
def test_every_offered_name_resolves_and_is_documented(surface):
    module = importlib.import_module(surface)
    undocumented = [name for name in module.__all__ if not inspect.getdoc(getattr(module, name))]
    assert undocumented == []


@pytest.mark.parametrize("surface", SURFACES)
def test_type_checkers_see_what_python_sees(surface):
    assert imported_for_type_checkers(surface) == set(importlib.import_module(surface).__all__)


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_says_what_it_is_and_that_it_is_typed(package):
    assert (SOURCES / package / package / "py.typed").is_file()
    assert '"py.typed"' in (SOURCES / package / "setup.py").read_text()
    assert importlib.import_module(package).__doc__


def test_a_package_is_imported_without_what_it_offers():
    packages = ", ".join(sorted({surface.split(".")[0] for surface in SURFACES}))
    heavy = ["casadi", "dask", "mujoco", "numba", "numpy", "pinocchio"]
    code = f"import sys, {packages}; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_inside_the_packages_modules_import_from_where_things_are_defined():
    offered = {surface: importlib.import_module(surface).__all__ for surface in SURFACES}
    through = [
        f"{file.relative_to(SOURCES)}:{node.lineno}"
        for file in SOURCES.glob("*/*/**/*.py")
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.ImportFrom) and any(alias.name in offered.get(node.module, ()) for alias in node.names)
    ]
    assert through == []
