"""A plan is taken where and as it begins: at rest from standing, in motion from the motion it begins with."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.kinematics import Kinematics
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_LINEAR, BASE_ORIENTATION, BASE_POSITION
from aerial_model.values.estimate import Estimate
from aerial_model.values.frame import StartFrame
from aerial_wbic.behaviours.acceptance import begins_in_motion, check_start

HEADING = 0.7  # [rad] of the robot in W
PLACE = np.array([3.0, -2.0, 0.0])  # [m] of the robot in W


@pytest.fixture
def trotting(robot, hop):
    """A plan that begins at 0.8 m/s ahead, pitching, and the estimate of a robot that moves like that somewhere else."""
    v = hop.v.copy()
    v[0, :6] = [0.8, 0.1, 0.0, 0.0, 1.0, 0.0]
    momentum = hop.angular_momentum.copy()
    momentum[0] = Kinematics(robot).at(hop.q[0], v[0]).angular_momentum
    plan = dataclasses.replace(hop, v=v, angular_momentum=momentum)
    placed = plan.placed(StartFrame(origin=PLACE, heading=HEADING))
    return plan, Estimate(time=1.0, q=placed.q[0].copy(), v=v[0].copy())


def refusal(plan, estimate, robot, gains):
    with pytest.raises(RefusalError) as caught:
        check_start(plan, estimate, robot, gains)
    return caught.value


def test_a_plan_that_begins_in_motion_is_taken_from_that_motion(robot, gains, trotting):
    plan, estimate = trotting
    assert begins_in_motion(plan, gains)
    check_start(plan, estimate, robot, gains)


@pytest.mark.parametrize("axis", range(3))
def test_not_from_another_velocity(robot, gains, trotting, axis):
    plan, estimate = trotting
    estimate.v[BASE_LINEAR][axis] += 1.1 * gains.start_velocity_tolerance
    refused = refusal(plan, estimate, robot, gains)
    assert (refused.code, "base velocity" in refused.reason) == (RefusalCode.START_MISMATCH, True)
    estimate.v[BASE_LINEAR][axis] -= 0.2 * gains.start_velocity_tolerance
    check_start(plan, estimate, robot, gains)


@pytest.mark.parametrize("axis", range(3))
def test_not_from_another_angular_momentum(robot, gains, trotting, axis):
    plan, estimate = trotting
    estimate.v[3 + axis] += 5.0
    refused = refusal(plan, estimate, robot, gains)
    assert (refused.code, "momentum" in refused.reason) == (RefusalCode.START_MISMATCH, True)


def test_a_robot_that_stands_cannot_begin_in_motion(robot, gains, trotting):
    plan, estimate = trotting
    estimate.v[:] = 0.0
    assert refusal(plan, estimate, robot, gains).code is RefusalCode.START_MISMATCH


def test_a_plan_that_begins_at_rest_is_taken_below_the_speed_limit(robot, gains, hop):
    assert not begins_in_motion(hop, gains)
    estimate = Estimate(time=1.0, q=hop.q[0].copy(), v=np.zeros(robot.model.nv))
    estimate.v[0] = 0.9 * gains.start_speed_tolerance
    check_start(hop, estimate, robot, gains)
    estimate.v[0] = 1.1 * gains.start_speed_tolerance
    assert refusal(hop, estimate, robot, gains).code is RefusalCode.NOT_STANDING


def test_a_plan_that_turns_as_it_begins_begins_in_motion(gains, hop):
    momentum = hop.angular_momentum.copy()
    momentum[0] = [0.0, 0.0, 1.1 * gains.start_momentum_tolerance]
    assert begins_in_motion(dataclasses.replace(hop, angular_momentum=momentum), gains)


def test_where_and_whereto_do_not_matter(robot, gains, hop):
    q = hop.q[0].copy()
    q[BASE_POSITION] += PLACE
    q[BASE_ORIENTATION] = rotation.multiply(rotation.about_z(HEADING), q[BASE_ORIENTATION])
    check_start(hop, Estimate(time=1.0, q=q, v=np.zeros(robot.model.nv)), robot, gains)


def test_a_plan_that_begins_in_the_air_is_refused(robot, gains, hop):
    plan = dataclasses.replace(hop, contact=np.zeros_like(hop.contact))
    estimate = Estimate(time=1.0, q=hop.q[0], v=np.zeros(robot.model.nv))
    assert refusal(plan, estimate, robot, gains).code is RefusalCode.INVALID_PLAN
