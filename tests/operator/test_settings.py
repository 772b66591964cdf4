import argparse
from dataclasses import dataclass
from enum import StrEnum

import pytest

from aerial_model.errors import ConfigurationError
from aerial_model.robot.robot import Robot
from aerial_operator.options.settings import EXAMPLE, setting, with_settings
from aerial_wbic.gains import ControllerGains

ROBOT = Robot.load("mini_cheetah")


@dataclass(frozen=True, kw_only=True)
class Inner:
    small: float = 1.0
    large: float = 2.0


class Order(StrEnum):
    FIRST = "first"
    LAST = "last"


@dataclass(frozen=True, kw_only=True)
class Section:
    number: float = 0.0
    order: Order = Order.FIRST
    inner: Inner = Inner()


def planner_section(*assignments):
    return with_settings(ROBOT, map(setting, assignments)).section("planner", Section)


def test_a_value_is_replaced():
    assert planner_section("planner.number=2.5").number == 2.5


def test_a_nested_value_is_replaced_and_its_neighbours_stay():
    inner = planner_section("planner.inner.small=3", "planner.inner.large=4").inner
    assert (inner.small, inner.large) == (3.0, 4.0)


def test_a_choice_is_made_by_its_name():
    assert planner_section("planner.order=last").order is Order.LAST


@pytest.mark.parametrize("text", ["lst", "3", "[last]"])
def test_what_is_no_choice_is_told_those_there_are(text):
    with pytest.raises(ConfigurationError, match=r"planner: order: no .*there are first, last"):
        planner_section(f"planner.order={text}")


def test_the_robot_it_came_from_is_unchanged():
    with_settings(ROBOT, [setting("planner.number=2.5")])
    assert "number" not in ROBOT.sections.get("planner", {})


def test_a_misspelt_key_is_named_by_the_one_who_reads_it():
    with pytest.raises(ConfigurationError, match="unknown key 'numbre' \\(did you mean 'number'"):
        planner_section("planner.numbre=2.5")


def test_a_misspelt_section_is_named():
    with pytest.raises(ConfigurationError, match="unknown section 'planer' \\(did you mean 'planner'"):
        planner_section("planer.number=2.5")


@pytest.mark.parametrize("text", ["number=1", "planner.number", "planner.=1", ".number=1", ""])
def test_what_is_no_assignment_is_a_usage_error_with_an_example(text):
    with pytest.raises(argparse.ArgumentTypeError, match=f"such as {EXAMPLE}"):
        setting(text)


def test_the_example_is_accepted_by_the_controller_and_changes_it():
    (_, key), value = setting(EXAMPLE)
    gains = with_settings(ROBOT, [setting(EXAMPLE)]).section("controller", ControllerGains)
    assert getattr(gains, key) != getattr(ROBOT.section("controller", ControllerGains), key)
    assert getattr(gains, key) == value


def test_a_value_that_is_no_yaml_is_a_usage_error():
    with pytest.raises(argparse.ArgumentTypeError, match="no YAML value"):
        setting("planner.number=[1")
