"""Small benchmarks, end to end."""

import numpy as np
import pytest
from PIL import Image

from aerial_evaluation.bench.planner import measured
from aerial_evaluation.bench.subject import Subject
from aerial_model.errors import ConfigurationError, RefusalError
from aerial_model.robot.robot import Robot


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture(scope="module")
def subject(robot, tmp_path_factory):
    return Subject(robot=robot, motions=("barrel_roll",), repeats=1, goals=1, folder=tmp_path_factory.mktemp("bench"))


@pytest.fixture(scope="module")
def profiles(subject):
    return list(measured(subject, ["profiles"]))


def test_the_blind_variant_asks_for_more_of_a_roll_than_there_is(profiles):
    worst = {row["variant"]: row["take_off"]["worst_voltage_ratio"] for row in profiles}
    assert worst["KD"] > 1.0 >= worst["AAKD*"]


def test_the_figure_shows_both(profiles):
    image = np.asarray(Image.open(profiles[0]["file"]).convert("RGB")).reshape(-1, 3).astype(int)
    for colour in ([0xC4, 0x4E, 0x33], [0x1F, 0x6F, 0x8B]):
        assert np.sum(np.all(np.abs(image - colour) < 8, axis=1)) > 100


def test_a_row_names_its_section_and_robot(profiles):
    assert all(row["section"] == "profiles" and row["robot"] == "mini_cheetah" for row in profiles)


def test_an_unknown_motion_is_refused_before_anything_is_measured(robot):
    with pytest.raises(RefusalError, match="unknown motion 'jmup'"):
        Subject(robot=robot, motions=("jmup",))


@pytest.mark.parametrize("what", ["repeats", "goals"])
def test_a_number_of_nothing_is_refused(robot, what):
    with pytest.raises(ConfigurationError, match=f"{what}: expected at least 1, found 0"):
        Subject(robot=robot, motions=("jump",), **{what: 0})
