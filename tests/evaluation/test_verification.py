"""Plans against MuJoCo's full dynamics."""

import dataclasses

import numpy as np
import pytest

from aerial_evaluation.judgement.verification import ATTITUDE_TOLERANCE, POSITION_TOLERANCE, verify
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.planner import Planner

VELOCITY_TOLERANCE = 1e-6  # [m/s]
MOMENTUM_TOLERANCE = 1e-3  # [kg·m²/s]

GOALS = [
    ("jump", np.array([0.8, 0.2, 0.0]), {"yaw": 0.5}),
    ("spin", np.zeros(3), {}),
    ("barrel_roll", np.zeros(3), {"rotation": -1.0}),
    ("front_flip", np.zeros(3), {}),
]


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture(scope="module", params=GOALS, ids=lambda goal: goal[0])
def plan(request, robot):
    motion, displacement, options = request.param
    return Planner(robot).plan(MotionRequest(motion=motion, displacement=displacement, **options)).plan


def test_a_plan_ends_at_its_goal_when_mujoco_integrates_it(robot, plan):
    verification = verify(robot, plan)
    assert verification.attitude_error < ATTITUDE_TOLERANCE
    assert verification.position_error < POSITION_TOLERANCE
    assert verification.passed


def test_the_planned_forces_lead_to_the_planned_take_off(robot, plan):
    verification = verify(robot, plan)
    assert verification.take_off_velocity_error < VELOCITY_TOLERANCE
    assert verification.momentum_error < MOMENTUM_TOLERANCE


def test_a_plan_whose_forces_do_not_lift_it_off_as_it_says_fails(robot, plan):
    verification = verify(robot, dataclasses.replace(plan, force=1.03 * plan.force))
    assert verification.take_off_velocity_error > VELOCITY_TOLERANCE
    assert not verification.passed


def test_a_plan_that_claims_another_winding_fails(robot, plan):
    turn = np.array([2 * np.pi, 0.0, 0.0])
    verification = verify(robot, dataclasses.replace(plan, rotation=plan.rotation + turn))
    assert not verification.passed
