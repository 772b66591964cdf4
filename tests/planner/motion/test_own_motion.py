"""A motion given as a mapping is the one that its YAML file would be."""

from __future__ import annotations

import numpy as np
import pytest

from aerial_model.config import load_yaml
from aerial_model.errors import ConfigurationError
from aerial_model.robot.robot import Robot
from aerial_planner.motion.motion import Motion, known_motions, load_motion


@pytest.mark.parametrize("name", ["jump", "back_flip", "barrel_roll"])
def test_a_mapping_says_what_the_file_says(name):
    robot = Robot.load("mini_cheetah")
    given, loaded = Motion.from_mapping(load_yaml(known_motions(robot)[name])), load_motion(name, robot)
    assert [phase.duration for phase in given.take_off] == [phase.duration for phase in loaded.take_off]
    assert given.goal == loaded.goal
    np.testing.assert_array_equal(given.displacement, loaded.displacement)


def test_a_misspelt_key_is_told():
    with pytest.raises(ConfigurationError, match=r"motion: unknown key 'takeoff' \(did you mean 'take_off'\?\)"):
        Motion.from_mapping({"summary": "", "takeoff": [], "flight": {"clearance": 0.1}, "goal": []})
