"""Accepted plans are flown by MuJoCo; what a benchmark counts as verified ends at its goal there."""

import dataclasses

import numpy as np
import pytest

from aerial_evaluation.bench.flown import flown
from aerial_evaluation.bench.samples import Sample, measure
from aerial_evaluation.judgement.verification import ATTITUDE_TOLERANCE, POSITION_TOLERANCE
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.planner import Planner


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture(scope="module")
def planned(robot):
    return measure(Planner(robot), MotionRequest(motion="jump", displacement=np.array([0.3, 0.0, 0.0])))


def with_force(sample, factor):
    """The sample with a plan whose feet push by so much more than its motion needs."""
    plan = dataclasses.replace(sample.result.plan, force=factor * sample.result.plan.force)
    return dataclasses.replace(sample, result=dataclasses.replace(sample.result, plan=plan))


def test_a_plan_that_ends_at_its_goal_is_verified_and_one_that_pushes_too_much_is_not(robot, planned):
    good = flown(robot, [planned])
    assert good.verified == 1
    assert good.worst_attitude_error_deg <= np.rad2deg(ATTITUDE_TOLERANCE)
    assert good.worst_position_error_m <= POSITION_TOLERANCE
    both = flown(robot, [planned, with_force(planned, 1.05)])
    assert both.verified == 1
    assert both.worst_position_error_m > POSITION_TOLERANCE


def test_refused_requests_are_not_flown(robot, planned):
    refused = Sample(report=planned.report, cpu_time=0.0, result=None)
    assert (flown(robot, [refused]).verified, flown(robot, [refused]).worst_position_error_m) == (0, None)
