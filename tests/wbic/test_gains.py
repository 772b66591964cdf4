"""Gains are read from the robot's folder, and a number that makes no sense is refused by name."""

from __future__ import annotations

import dataclasses

import pytest

from aerial_model.errors import ConfigurationError
from aerial_wbic.controller import Controller
from aerial_wbic.gains import EstimatorNoise


@pytest.mark.parametrize(
    "name", ["weight_base", "weight_force", "stiction_speed", "settling_rate", "landing_depth", "landing_turn"]
)
def test_what_is_divided_by_must_be_positive(gains, name):
    with pytest.raises(ValueError, match=name):
        dataclasses.replace(gains, **{name: 0.0})


@pytest.mark.parametrize("name", ["joint_damping", "angular_momentum_damping", "fall_tilt"])
def test_nothing_is_negative(gains, name):
    with pytest.raises(ValueError, match=name):
        dataclasses.replace(gains, **{name: -1.0})


@pytest.mark.parametrize(("name", "value"), [("stiffness", -1.0), ("damping", 0.0)])
def test_feedback_needs_damping(gains, name, value):
    position = gains.hold.position._replace(**{name: value})
    with pytest.raises(ValueError, match=rf"hold\.position\.{name} must"):
        dataclasses.replace(gains, hold=gains.hold._replace(position=position))


@pytest.mark.parametrize("name", [name for name in EstimatorNoise._fields if name != "foot_velocity_share"])
def test_the_noise_assumed_must_be_positive(gains, name):
    with pytest.raises(ValueError, match=rf"estimator\.{name} must be positive"):
        dataclasses.replace(gains, estimator=gains.estimator._replace(**{name: 0.0}))


def test_a_misspelt_gain_is_named(robot):
    with pytest.raises(ConfigurationError, match="did you mean 'joint_damping'"):
        Controller(robot.with_section("controller", joint_dampning=1.0))


def test_a_missing_section_is_named(robot):
    bare = dataclasses.replace(robot, sections={})
    with pytest.raises(ConfigurationError, match="controller: key 'follow' is missing"):
        Controller(bare)


def test_a_choice_is_named_with_all_there_are(robot):
    with pytest.raises(
        ConfigurationError, match=r"tasks: no 'wbc_d' \(did you mean '.*'\?\); there are wbc_a, wbc_b, wbc_c, weighted"
    ):
        Controller(robot.with_section("controller", tasks="wbc_d"))
