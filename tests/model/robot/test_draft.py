"""A draft from a URDF alone is a robot that stands."""

import re

import numpy as np
import pytest

from aerial_model.errors import ConfigurationError
from aerial_model.robot.draft.draft import draft
from aerial_model.robot.loading import known_robots
from aerial_model.robot.robot import Robot


@pytest.fixture(params=["mini_cheetah", "mit_humanoid"])
def pair(request, tmp_path):
    """A robot that comes with the project, and what a draft makes of its URDF."""
    urdf = known_robots()[request.param] / "robot.urdf"
    (tmp_path / "robot.yaml").write_text(draft(urdf, "drafted").text)
    return Robot.load(request.param), Robot.load(tmp_path)


def test_it_finds_the_feet(pair):
    known, drafted = pair
    assert {int(link) for link in drafted.contact_links} == {int(link) for link in known.contact_links}


def test_it_stands_level_on_all_points_with_its_legs_bent(pair):
    _, drafted = pair
    q = drafted.standing_configuration()
    points = drafted.contact_positions(q)
    np.testing.assert_allclose(points[:, 2], points[0, 2], atol=2e-3)
    low, high = drafted.model.lowerPositionLimit[7:], drafted.model.upperPositionLimit[7:]
    assert np.all((drafted.poses["home"] >= low) & (drafted.poses["home"] <= high))
    knees = [j for j, name in enumerate(drafted.joint_names) if "knee" in name]
    assert np.all(np.abs(drafted.poses["home"][knees]) > 0.3)


def test_its_motors_have_the_limits_of_the_urdf(pair):
    _, drafted = pair
    model, law = drafted.model, drafted.actuators
    np.testing.assert_allclose(law.torque_max, model.effortLimit[6:], rtol=1e-4)
    np.testing.assert_allclose(law.no_load_speed, model.velocityLimit[6:], rtol=1e-3)


def test_every_guess_is_marked(pair):
    _, drafted = pair
    text = (drafted.folder / "robot.yaml").read_text()
    for guessed in ("contact_points", "bus_voltage", "actuators", "poses"):
        assert re.search(rf"^{guessed}:.*GUESS", text, re.MULTILINE)


def test_plans_swing_arms_and_hold_all_else_that_is_no_leg(pair):
    known, drafted = pair
    held = {name for name, h in zip(drafted.joint_names, drafted.held_joints, strict=True) if h}
    arms = {known.joint_names[j] for j in known.arms}
    assert held == {name for name in arms if "shoulder_pitch" not in name}


def test_small_numbers_are_numbers_to_yaml(tmp_path):
    text = (known_robots()["mini_cheetah"] / "robot.urdf").read_text()
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(re.sub(r'effort="[\d.]+"', 'effort="0.6"', text))
    (tmp_path / "robot.yaml").write_text(draft(urdf, "weak").text)
    assert Robot.load(tmp_path).actuators.rotor_inertia[0] == pytest.approx(6e-8)


def test_limits_that_say_nothing_are_replaced_and_told(tmp_path):
    text = (known_robots()["mini_cheetah"] / "robot.urdf").read_text()
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(re.sub(r'effort="[\d.]+" velocity="[\d.]+"', 'effort="1000" velocity="0"', text))
    made = draft(urdf, "limitless")
    assert sum("is no motor's limit" in guess for guess in made.guesses) == 12
    (tmp_path / "robot.yaml").write_text(made.text)
    assert np.all(Robot.load(tmp_path).actuators.torque_max < 40.0)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("<robot name='x'><link name='a'/></robot>", "a robot that jumps has legs"),
        ("nothing", "not a URDF"),
        ("<sdf/>", "not a URDF"),
    ],
)
def test_what_has_no_legs_is_refused(tmp_path, text, sentence):
    urdf = tmp_path / "x.urdf"
    urdf.write_text(text)
    with pytest.raises(ConfigurationError, match=sentence):
        draft(urdf, "x")
