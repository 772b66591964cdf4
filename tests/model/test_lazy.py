"""Re-exported names come from where they are defined, when they are asked for and not before."""

from __future__ import annotations

import sys

import pytest

from aerial_model.lazy import reexport

SURFACE = """
from aerial_model.lazy import reexport
__getattr__, __dir__ = reexport(__name__, {"inner.shape": ["Circle", "Square"]})
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package whose surface offers two classes of an inner module."""
    inner = tmp_path / "probe_of_lazy/inner"
    inner.mkdir(parents=True)
    (inner.parent / "__init__.py").write_text(SURFACE)
    (inner / "__init__.py").write_text("")
    (inner / "shape.py").write_text("class Circle: pass\nclass Square: pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    import probe_of_lazy

    yield probe_of_lazy
    for name in [name for name in sys.modules if name.startswith("probe_of_lazy")]:
        del sys.modules[name]


def test_nothing_is_imported_before_a_name_is_asked_for(package):
    assert "probe_of_lazy.inner.shape" not in sys.modules
    assert package.Circle is sys.modules["probe_of_lazy.inner.shape"].Circle


def test_a_name_is_looked_up_once(package):
    assert "Square" not in vars(package)
    assert package.Square is vars(package)["Square"]


def test_all_names_are_listed(package):
    assert {"Circle", "Square"} <= set(dir(package))


def test_an_unknown_name_is_an_error_that_lists_the_known_ones(package):
    with pytest.raises(AttributeError, match=r"no attribute 'Triangle'; it has Circle, Square"):
        _ = package.Triangle


def test_a_module_that_is_missing_is_not_taken_for_a_missing_name():
    getattribute, _ = reexport("aerial_model", {"no_such_module": ["Name"]})
    with pytest.raises(ModuleNotFoundError, match=r"aerial_model\.no_such_module"):
        getattribute("Name")
