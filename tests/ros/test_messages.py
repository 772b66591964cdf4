"""Values that cross a process border come back as they were, in every field they have or will have."""

import dataclasses

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from aerial_model.errors import ConfigurationError, RefusalCode, RefusalError
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import BOXES_MAX, Box, Terrain
from aerial_msgs.msg import MotionSelection, TerrainBox
from aerial_ros.messages import (
    selection_from_message,
    selection_to_message,
    terrain_from_message,
    terrain_to_message,
)

BOX = Box(centre=[0.5, -0.1, 0.08], size=[0.9, 0.8, 0.16], yaw=0.3)
ANOTHER = {  # a value for each field of a request that is not its default
    "motion": "spin",
    "displacement": np.array([0.3, -0.1, 0.16]),
    "yaw": 0.7,
    "rotation": -0.5,
    "terrain": Terrain(boxes=(BOX,)),
    "variant": "KD",
    "warm_start": False,
    "optimize_timing": True,
    "request_id": "one",
}
FIELDS = [field.name for field in dataclasses.fields(MotionRequest)]


def through_the_wire(request):
    return selection_from_message(
        deserialize_message(serialize_message(selection_to_message(request)), MotionSelection)
    )


def assert_equal(a, b):
    for name in FIELDS:
        if name == "terrain":
            assert_equal_terrain(a.terrain, b.terrain)
        else:
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


def assert_equal_terrain(a, b):
    assert a.base == b.base
    for one, other in zip(a.boxes, b.boxes, strict=True):
        np.testing.assert_array_equal(one.centre, other.centre)
        np.testing.assert_array_equal(one.size, other.size)
        assert one.yaw == other.yaw


@pytest.mark.parametrize("name", FIELDS)
def test_each_field_of_a_request_survives_the_wire(name):
    request = dataclasses.replace(MotionRequest(motion="jump"), **{name: ANOTHER[name]})
    assert_equal(through_the_wire(request), request)


def test_a_selection_that_leaves_all_out_is_the_default_request():
    assert_equal(selection_from_message(MotionSelection(motion="jump")), MotionRequest(motion="jump"))


def test_a_terrain_survives_the_wire():
    terrain = Terrain(boxes=(BOX, Box(centre=[1.0, 2.0, -0.3], size=[0.1, 0.2, 0.3])), base=0.25)
    assert_equal_terrain(terrain_from_message(terrain_to_message(terrain), terrain.base), terrain)


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (MotionSelection(displacement=[np.nan, 0.0, 0.0]), "displacement: expected finite numbers"),
        (MotionSelection(yaw=float("inf")), "yaw and rotation must be finite"),
        (MotionSelection(terrain=[TerrainBox(size=[1.0, 0.0, 1.0])]), "box 0: box size"),
        (MotionSelection(terrain=(BOXES_MAX + 1) * [TerrainBox(size=[1.0, 1.0, 1.0])]), "at most 64 boxes"),
    ],
)
def test_a_selection_that_makes_no_sense_is_refused_by_field(message, words):
    with pytest.raises(RefusalError, match=words) as refusal:
        selection_from_message(message)
    assert refusal.value.code is RefusalCode.INVALID_REQUEST


def test_a_floor_that_is_no_number_is_refused():
    with pytest.raises(ConfigurationError, match="base: expected a finite height"):
        terrain_from_message([], float("nan"))
