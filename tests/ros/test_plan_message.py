"""A plan as a message: what arrives is what was sent, or is refused with the reason."""

import dataclasses

import numpy as np
import pytest

from aerial_model.errors import InvalidPlanError
from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Plan
from aerial_model.values.terrain import Box, Terrain
from aerial_msgs.msg import MotionPlan
from aerial_ros.messages import plan_from_message, plan_to_message

K = 4


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture(scope="module")
def plan(robot):
    """A plan that begins in motion, on other points and other footholds in each phase."""
    random = np.random.default_rng(0)
    n_c, nv = robot.n_contacts, robot.model.nv
    return Plan(
        motion="jump",
        robot=robot.name,
        model_hash=robot.model_hash,
        time=np.array([0.0, 0.1, 0.2, 0.6]),
        q=np.tile(robot.standing_configuration(), (K, 1)),
        v=random.normal(size=(K, nv)),
        com=random.normal(size=(K, 3)),
        com_velocity=random.normal(size=(K, 3)),
        angular_momentum=random.normal(size=(K, 3)),
        foot_position=random.normal(size=(K, n_c, 3)),
        force=random.normal(size=(K, n_c, 3)),
        contact=np.array([[True, False, False, True], [False, True, True, False], [False] * 4, [False] * 4]),
        take_off_time=0.2,
        landing_time=0.6,
        landing_joint_position=robot.poses["landing"],
        landing_com_height=0.25,
        landing_support_centre=np.array([0.6, 0.0, 0.2]),
        landing_yaw=0.1,
        rotation=np.array([0.0, 0.0, 0.1]),
        terrain=Terrain(boxes=(Box(centre=np.array([0.8, 0.0, 0.1]), size=np.array([0.9, 0.8, 0.2]), yaw=0.1),)),
        request_id="7",
    ).checked(robot)


def test_a_plan_arrives_as_it_was_sent(plan, robot):
    arrived = plan_from_message(plan_to_message(plan, robot), robot)
    np.testing.assert_equal(dataclasses.asdict(arrived), dataclasses.asdict(plan))


def test_an_unknown_ending_is_refused(plan, robot):
    message = plan_to_message(plan, robot)
    message.ending = 7
    with pytest.raises(InvalidPlanError, match=r"plan field ending: unknown ending 7; known: 0 \(stand\)"):
        plan_from_message(message, robot)


def test_a_stand_is_what_a_message_says_that_says_nothing():
    assert MotionPlan().ending == MotionPlan.STAND
