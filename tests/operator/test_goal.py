"""From options to a request."""

import argparse

import numpy as np
import pytest

from aerial_model.robot.robot import Robot
from aerial_operator.__main__ import join_negative_values
from aerial_operator.commands import plan, select, simulate
from aerial_operator.console import UsageError
from aerial_operator.options.goal import add_goal_arguments, request_from
from aerial_operator.options.planning import planner_choices

ROBOT = Robot.load("mini_cheetah")


def parse(line):
    parser = argparse.ArgumentParser(exit_on_error=False)
    add_goal_arguments(parser)
    return parser.parse_args(join_negative_values(line.split()))


def request(line):
    return request_from(parse(line), ROBOT)


@pytest.mark.parametrize(
    ("options", "displacement"),
    [
        ("", [0, 0, 0]),
        ("--to 0.3,0,0", [0.3, 0, 0]),
        ("--to 0.3,0.1", [0.3, 0.1, 0]),
        ("--to -0.2,0,0", [-0.2, 0, 0]),
        ("--to=-.2,-1e-1,0", [-0.2, -0.1, 0]),
        ("--to 0.6,0,0.16", [0.6, 0, 0.16]),
        ("--to 0.6,0 --platform 0.16", [0.6, 0, 0.16]),
        ("--to 0.6,0 --platform -0.1", [0.6, 0, -0.1]),
        ("--to 0.6,0,0 --platform 0.16 --edge 2", [0.6, 0, 0]),
    ],
)
def test_the_goal_is_read(options, displacement):
    np.testing.assert_allclose(request(f"jump {options}").displacement, displacement)


def test_turns_are_read_with_their_sign():
    asked = request("spin --yaw -1.5 --rotation -0.5")
    assert (asked.yaw, asked.rotation) == (-1.5, -0.5)


def test_flat_ground_has_no_boxes():
    assert request("jump --to 0.3,0,0").terrain.boxes == ()


@pytest.mark.parametrize(
    "options", ["--to 0.6,0,0.16", "--to 0.6,0 --platform 0.16", "--to 0.6,0,0.16 --platform 0.16"]
)
def test_a_landing_height_and_a_platform_imply_each_other(options):
    (box,) = request(f"jump {options}").terrain.boxes
    assert box.top == pytest.approx(0.16)


def test_a_given_edge_is_where_the_platform_begins():
    (box,) = request("jump --to 0.6,0,0.16 --edge 0.3").terrain.boxes
    assert box.centre[0] - box.size[0] / 2 == pytest.approx(0.3)


def test_a_hurdle_leaves_the_goal_on_the_ground():
    asked = request("jump --to 0.6,0 --hurdle 0.1")
    assert asked.displacement[2] == 0.0
    assert asked.terrain.boxes[0].top == pytest.approx(0.1)


def test_a_gap_leaves_the_goal_on_the_far_bank():
    near, far = request("jump --to 0.7,0 --gap 0.2 --edge 0.25").terrain.boxes
    assert (near.top, far.top) == (0.0, 0.0)
    assert far.centre[0] - far.size[0] / 2 == pytest.approx(0.45)


@pytest.mark.parametrize("text", ["a,b", "1", "1,2,3,4", "1,,2", "nan,0", "inf,0,0", ""])
def test_what_is_no_place_is_a_usage_error_with_an_example(text):
    with pytest.raises(argparse.ArgumentError, match=r"such as 0\.3,0,0"):
        parse(f"jump --to={text}")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--edge 0.3", "none is asked for"),
        ("--platform 0", "other than 0"),
        ("--hurdle -0.1", "positive height"),
        ("--gap 0", "positive width"),
    ],
)
def test_options_that_contradict_each_other_are_usage_errors(options, words):
    with pytest.raises(UsageError, match=words):
        request(f"jump --to 0.6,0 {options}")


@pytest.mark.parametrize("command", [plan, simulate, select], ids=lambda command: command.__name__.rpartition(".")[2])
def test_every_command_that_asks_for_a_motion_lets_the_request_choose_of_the_planner(command):
    parser = argparse.ArgumentParser(exit_on_error=False)
    command.add_arguments(parser)
    args = parser.parse_args(["jump", "--variant", "KD", "--no-warm-start", "--optimize-timing"])
    asked = request_from(args, ROBOT, **planner_choices(args))
    assert (asked.variant, asked.warm_start, asked.optimize_timing) == ("KD", False, True)
