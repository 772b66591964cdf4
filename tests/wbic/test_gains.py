"""Gains are read from the robot's folder, and a number that makes no sense is refused by name."""

from __future__ import annotations

import dataclasses

import pytest

from aerial_model.config import from_mapping
from aerial_model.errors import ConfigurationError
from aerial_model.robot.scale import Scale
from aerial_wbic.controller import Controller
from aerial_wbic.gains import ControllerGains, EstimatorNoise


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


def test_a_robot_that_says_nothing_has_the_reference_robots_gains(robot, gains):
    bare = dataclasses.replace(robot, sections={})
    assert bare.section("controller", ControllerGains) == gains


def test_gains_grow_with_the_robot_as_their_units_do(gains):
    larger = from_mapping(ControllerGains, ControllerGains.defaults(Scale(mass=8.0, length=4.0)), "test")
    assert larger.hold.position.stiffness == gains.hold.position.stiffness / 4  # 1/s², times go with √4
    assert larger.settling_rate == gains.settling_rate / 2
    assert larger.landing_depth == 4 * gains.landing_depth
    assert larger.joint_damping == pytest.approx(8 * 16 / 2 * gains.joint_damping)
    assert larger.estimator == gains.estimator


def test_a_choice_is_named_with_all_there_are(robot):
    with pytest.raises(
        ConfigurationError, match=r"tasks: no 'wbc_d' \(did you mean '.*'\?\); there are wbc_a, wbc_b, wbc_c, weighted"
    ):
        Controller(robot.with_section("controller", tasks="wbc_d"))
