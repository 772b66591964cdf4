"""Manifests say what the code needs, so that rosdep can install it and colcon builds in the right order; one version."""

import ast
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from aerial_model import __version__
from aerial_operator.__main__ import main

TOP = Path(__file__).resolve().parents[2]
SOURCES = TOP / "src"
PACKAGES = sorted(setup.parent.name for setup in SOURCES.glob("*/setup.py"))
ROSDEP_KEYS = {"PIL": "python3-pil", "matplotlib": "python3-matplotlib", "numpy": "python3-numpy"}
ROSDEP_KEYS |= {
    "distributed": "python3-distributed",
    "numba": "python3-numba",
    "scipy": "python3-scipy",
    "yaml": "python3-yaml",
}
WITHOUT_ROSDEP_KEY = {
    "casadi",
    "coal",
    "daqp",
    "mujoco",
    "osqp",
    "pinocchio",
    "rosbags",
}  # README: from requirements.txt
IN_ITS_OWN_ENVIRONMENT = {"crocoddyl", "tsid"}  # peers, in environments that `aerial bench … --with-peers` makes

ONLY_IF_INSTALLED = {"proxsuite", "quadprog"}  # peers of `aerial bench controller`

NOT_DECLARED = WITHOUT_ROSDEP_KEY | IN_ITS_OWN_ENVIRONMENT | ONLY_IF_INSTALLED


def imports(package):
    """Top-level modules that a package's code imports."""
    names = set()
    for file in (SOURCES / package / package).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(node.module.split(".")[0])
    return names - set(sys.stdlib_module_names) - {package}


@pytest.mark.parametrize("package", PACKAGES)
def test_a_manifest_names_every_import(package):
    manifest = ElementTree.parse(SOURCES / package / "package.xml")
    declared = {element.text for kind in ("depend", "exec_depend") for element in manifest.iter(kind)}
    assert {ROSDEP_KEYS.get(name, name) for name in imports(package) - NOT_DECLARED} <= declared


@pytest.mark.parametrize("manifest", sorted(SOURCES.glob("*/package.xml")), ids=lambda path: path.parent.name)
def test_a_manifest_has_the_projects_version(manifest):
    assert ElementTree.parse(manifest).findtext("version") == __version__


@pytest.mark.parametrize("package", PACKAGES)
def test_a_distribution_has_the_projects_version(package):
    assert f'version="{__version__}"' in (SOURCES / package / "setup.py").read_text()


def test_the_command_line_tells_the_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"aerial {__version__}\n"


def test_the_script_tells_the_version():
    done = subprocess.run([TOP / "aerial", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"aerial {__version__}\n"


def test_the_newest_release_of_the_changelog_is_the_version():
    heads = re.findall(r"^## \[(.*?)\](?: - (\d{4}-\d{2}-\d{2}))?$", (TOP / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert heads[0] == ("Unreleased", "")
    assert heads[1][0] == __version__
    assert heads[1][1]
