"""The estimate in closed loop: as good as it claims in every phase, also when the landing is higher than the start."""

import numpy as np
import pytest

from aerial_evaluation.closed_loop import run
from aerial_evaluation.judgement.consistency import PHASES, summary
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.planner import Planner

SEEDS = 4
HEIGHT = 0.16  # [m]
HEIGHT_TOLERANCE = 0.02  # after a flight without any measurement of the position [m]


@pytest.fixture(scope="module")
def outcomes():
    robot = Robot.load("mini_cheetah")
    request = MotionRequest(motion="jump", displacement=np.array([0.6, 0.0, HEIGHT])).with_platform(robot)
    planner = Planner(robot)
    return [run(robot, request, seed=seed, planner=planner) for seed in range(SEEDS)]


def test_the_estimate_is_as_good_as_it_claims_in_every_phase(outcomes):
    figures = summary([outcome.estimate for outcome in outcomes])
    assert list(figures) == list(PHASES)
    for row in figures.values():
        assert max(row["position_nees"], row["velocity_nees"]) < row["nees_interval95"][1]


def test_feet_on_a_platform_are_not_believed_on_the_floor(outcomes):
    for outcome in outcomes:
        assert outcome.landing.failed == ()
        assert outcome.estimate["landing"]["position_m"][-1] < HEIGHT_TOLERANCE
