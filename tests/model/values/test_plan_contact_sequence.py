"""The contact sequence that a plan tells: phases, durations, footholds."""

import dataclasses

import numpy as np
import pytest

from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Plan

TIME = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.6])
CONTACT = np.array([[1, 0, 0, 1], [1, 0, 0, 1], [1, 1, 0, 0], [0, 1, 1, 0], [0, 0, 0, 0], [0, 0, 0, 0]], dtype=bool)
DRIFT = 1e-5  # of feet from knot to knot, as optimized ones have [m]


@pytest.fixture(scope="module")
def plan():
    robot = Robot.load("mini_cheetah")
    K, n_c = CONTACT.shape
    feet = robot.contact_positions(robot.standing_configuration()) + DRIFT * np.arange(K)[:, None, None]
    return Plan(
        motion="jump",
        robot=robot.name,
        model_hash=robot.model_hash,
        time=TIME,
        q=np.tile(robot.standing_configuration(), (K, 1)),
        v=np.zeros((K, robot.model.nv)),
        com=np.zeros((K, 3)),
        com_velocity=np.zeros((K, 3)),
        angular_momentum=np.zeros((K, 3)),
        foot_position=feet,
        force=np.zeros((K, n_c, 3)),
        contact=CONTACT,
        take_off_time=0.4,
        landing_time=0.6,
        landing_joint_position=robot.poses["landing"],
        landing_com_height=0.25,
        landing_support_centre=np.zeros(3),
        landing_yaw=0.0,
        rotation=np.zeros(3),
    ).checked(robot)


def test_the_contact_sequence_has_a_phase_for_each_set_of_contacts(plan):
    phases = plan.contact_sequence.phases
    assert [phase.duration for phase in phases] == pytest.approx([0.2, 0.1, 0.1, 0.2])
    np.testing.assert_array_equal([phase.contact for phase in phases], CONTACT[[0, 2, 3, 4]])


def test_a_point_keeps_its_foothold_as_long_as_it_bears_load(plan):
    first, second, third, _ = plan.contact_sequence.phases
    np.testing.assert_array_equal(first.foothold, plan.foot_position[0])
    np.testing.assert_array_equal(second.foothold[:2], [plan.foot_position[0, 0], plan.foot_position[2, 1]])
    np.testing.assert_array_equal(third.foothold[1:3], [plan.foot_position[2, 1], plan.foot_position[3, 2]])


def test_the_last_row_is_no_phase(plan):
    contact = plan.contact.copy()
    contact[-1] = True  # it holds for no time
    phases = dataclasses.replace(plan, contact=contact).contact_sequence.phases
    assert sum(phase.duration for phase in phases) == pytest.approx(TIME[-1])
    assert not phases[-1].contact.any()
