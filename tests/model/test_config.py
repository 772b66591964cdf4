"""YAML mappings become values, and every mistake in them one sentence that says where and what is known."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

import numpy as np
import pytest

from aerial_model.config import closest, from_mapping, frozen_array, load_yaml, merged, positive
from aerial_model.errors import ConfigurationError


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


class Feedback(NamedTuple):
    stiffness: float
    damping: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Leg:
    name: str
    gains: Feedback
    count: int = 4
    range: tuple[float, float] = (0.0, 1.0)
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    colour: Colour = Colour.RED
    spare: float | None = None


GIVEN = {
    "name": "front",
    "gains": {"stiffness": 3},
    "range": [1, 2.5],
    "offset": [1, 2, 3],
    "colour": "blue",
    "spare": None,
}


def test_a_mapping_becomes_the_value_it_says():
    leg = from_mapping(Leg, GIVEN, "file")
    assert (leg.name, leg.gains, leg.count, leg.range) == ("front", Feedback(3.0, 1.0), 4, (1.0, 2.5))
    assert (leg.colour, leg.spare) == (Colour.BLUE, None)
    assert leg.offset.tolist() == [1.0, 2.0, 3.0]
    assert not leg.offset.flags.writeable


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"nam": "x"}, r"file: unknown key 'nam' \(did you mean 'name'\?\); known: name, gains"),
        ({"gains": {"damping": 1}}, "file: gains: key 'stiffness' is missing"),
        ({"gains": 3}, "file: gains: expected a mapping, found 3"),
        ({"count": 1.5}, "file: count: expected a whole number, found 1.5"),
        ({"count": True}, "file: count: expected a finite number, found True"),
        ({"spare": float("nan")}, "file: spare: expected a finite number"),
        ({"range": [1]}, "file: range: expected 2 values, found 1"),
        ({"range": 1}, "file: range: expected a list, found 1"),
        ({"offset": "far"}, "file: offset: expected numbers, found 'far'"),
        ({"colour": "rod"}, r"file: colour: no 'rod' \(did you mean 'red'\?\); there are red, blue"),
        ({"name": 3}, "file: name: expected str, found 3"),
    ],
)
def test_a_mistake_is_told_with_its_place(change, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        from_mapping(Leg, GIVEN | change, "file")


def test_what_is_on_top_replaces_key_by_key():
    base, top = {"a": {"x": 1, "y": 2}, "b": 3}, {"a": {"y": 4}, "c": 5}
    assert merged(base, top) == {"a": {"x": 1, "y": 4}, "b": 3, "c": 5}
    assert base == {"a": {"x": 1, "y": 2}, "b": 3}


def test_a_name_like_none_is_near_none():
    assert closest("zzz", ["jump", "spin"]) == ""


@pytest.mark.parametrize("value", [0, -1.0, True, "1", float("nan"), None])
def test_what_is_no_positive_number_is_refused(value):
    with pytest.raises(ConfigurationError, match="mass: expected a positive number"):
        positive(value, "mass")


@pytest.mark.parametrize(
    ("text", "sentence"), [("a: [", "not valid YAML"), ("- a", "expected a mapping"), (None, "cannot be read")]
)
def test_a_file_that_holds_no_mapping_is_refused(tmp_path, text, sentence):
    file = tmp_path / "x.yaml"
    if text is not None:
        file.write_text(text)
    with pytest.raises(ConfigurationError, match=sentence):
        load_yaml(file)


def test_an_array_has_the_shape_that_is_asked_for():
    with pytest.raises(ConfigurationError, match=r"offset: expected shape \(3,\), found \(2,\)"):
        frozen_array([1, 2], "offset", (3,))
