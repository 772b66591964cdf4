"""The estimate in closed loop: as good as it claims in every phase, also when the landing is higher than the start."""

import numpy as np
import pytest

from aerial_evaluation.closed_loop import run
from aerial_evaluation.judgement.consistency import PHASES, sampled, summary
from aerial_evaluation.judgement.landing import judge
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.planner import Planner

SEEDS = 4
HEIGHT = 0.16  # [m]
HEIGHT_TOLERANCE = 0.02  # after a flight without any measurement of the position [m]


@pytest.fixture(scope="module")
def runs():
    robot = Robot.load("mini_cheetah")
    request = MotionRequest(motion="jump", displacement=np.array([0.6, 0.0, HEIGHT])).with_platform(robot)
    planner = Planner(robot)
    return [run(robot, request, seed=seed, planner=planner) for seed in range(SEEDS)]


def test_the_estimate_is_as_good_as_it_claims_in_every_phase(runs):
    figures = summary([sampled(record) for record in runs])
    assert list(figures) == list(PHASES)
    for row in figures.values():
        assert max(row.normalized["position_nees"], row.normalized["velocity_nees"]) < row.interval[1]


def test_feet_on_a_platform_are_not_believed_on_the_floor(runs):
    for record in runs:
        assert judge(record).failed == ()
        assert sampled(record)["landing"]["position_m"][-1] < HEIGHT_TOLERANCE
