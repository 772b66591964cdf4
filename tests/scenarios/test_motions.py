"""Whole motions in closed loop: planner, controller and simulator with nominal noise, judged from ground truth."""

import numpy as np
import pytest

from aerial_evaluation.closed_loop import run
from aerial_evaluation.judgement.landing import judge
from aerial_model.errors import RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.planner import Planner


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture(scope="module")
def planner(robot):
    return Planner(robot)


def jump(robot, *displacement, **options):
    request = MotionRequest(motion="jump", displacement=np.array(displacement), **options)
    return request.with_platform(robot) if displacement[2] else request


@pytest.mark.parametrize(
    "displacement",
    [(0.4, 0.0, 0.0), (-0.2, 0.0, 0.0), (0.0, 0.2, 0.0), (0.6, 0.0, 0.16), (0.7, 0.0, -0.1)],
    ids=["forward", "backward", "left", "onto a platform", "off a platform"],
)
def test_a_jump_lands(robot, planner, displacement):
    assert judge(run(robot, jump(robot, *displacement), seed=1, planner=planner)).failed == ()


@pytest.mark.parametrize("across", [False, True], ids=["hurdle", "gap"])
def test_a_jump_over_an_obstacle_lands(robot, planner, across):
    request = jump(robot, 0.8, 0.0, 0.0)
    request = request.with_gap(robot, 0.3) if across else request.with_hurdle(robot, 0.1)
    assert judge(run(robot, request, seed=1, planner=planner)).failed == ()


@pytest.mark.parametrize(
    ("motion", "goal"),
    [
        ("spin", {"rotation": -0.5}),
        ("barrel_roll", {}),
        ("barrel_roll", {"rotation": -1.0}),
        ("barrel_roll", {"displacement": np.array([0.0, -0.35, 0.0])}),
        ("front_flip", {}),
        ("back_flip", {}),
    ],
    ids=["spin right", "roll right", "roll left", "far roll", "front flip", "back flip"],
)
def test_a_turning_motion_lands(robot, planner, motion, goal):
    assert judge(run(robot, MotionRequest(motion=motion, **goal), seed=1, planner=planner)).failed == ()


def test_a_jump_with_optimized_timing_lands(robot, planner):
    record = run(robot, jump(robot, 0.8, 0.0, 0.0, optimize_timing=True), seed=1, planner=planner)
    assert record.plan.take_off_time < 0.35  # [s], instead of 0.4
    assert judge(record).failed == ()


def test_equal_seeds_give_equal_runs_to_the_last_bit(robot, planner):
    first, second = (run(robot, jump(robot, 0.3, 0.0, 0.0), seed=2, planner=planner) for _ in range(2))
    for one, other in zip(first.ticks, second.ticks, strict=True):
        np.testing.assert_array_equal(one.truth.q, other.truth.q)
        np.testing.assert_array_equal(one.truth.requested_torque, other.truth.requested_torque)


def test_a_goal_out_of_reach_is_refused(robot, planner):
    with pytest.raises(RefusalError):
        run(robot, jump(robot, 3.0, 0.0, 0.0), planner=planner)
