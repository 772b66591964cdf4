"""Following a plan: its samples in the world's axes, its phases, and what happens when the ground does not come in time."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ANGULAR, JOINT_VELOCITY
from aerial_model.values.frame import StartFrame
from aerial_wbic.behaviours.behaviour import Entry, Event, Setting
from aerial_wbic.behaviours.follow_plan import FollowPlan, PlanTarget
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.gains import Touchdown

BEGIN = 7.0  # [s] clock time at which the plan begins
TWO_DOWN = np.array([True, False, False, True])
NONE_DOWN = np.zeros(4, dtype=bool)


@pytest.fixture
def following(robot, gains, hop):
    """A plan that has begun: ``following(touchdown, plan)``."""

    def following(touchdown=Touchdown.TIME, plan=hop):
        setting = Setting(robot=robot, gains=dataclasses.replace(gains, touchdown=touchdown), home_height=0.25)
        behaviour = FollowPlan(setting, Entry(Event.PLAN_ACCEPTED, plan=plan))
        behaviour.begin(BEGIN)
        return behaviour

    return following


def test_its_phases_and_contacts_are_the_plans(following, hop):
    behaviour = following()
    in_the_air = BEGIN + hop.take_off_time
    assert (behaviour.phase(in_the_air - 0.002), behaviour.phase(in_the_air)) == (Phase.TAKE_OFF, Phase.FLIGHT)
    assert behaviour.contact(in_the_air - 0.002).all()
    assert not behaviour.contact(in_the_air).any()


@pytest.mark.parametrize(
    ("touchdown", "late", "touching", "event"),
    [
        (Touchdown.TIME, -0.002, TWO_DOWN, None),
        (Touchdown.TIME, 0.0, NONE_DOWN, Event.TOUCHDOWN),
        (Touchdown.CONTACT, -0.002, NONE_DOWN, None),
        (Touchdown.CONTACT, -0.002, TWO_DOWN, Event.TOUCHDOWN),
        (Touchdown.CONTACT, 0.002, NONE_DOWN, None),
        (Touchdown.CONTACT, 0.101, NONE_DOWN, Event.TOUCHDOWN),  # patience is at its end
    ],
)
def test_a_flight_ends_by_time_or_by_contacts_that_are_felt(following, hop, touchdown, late, touching, event):
    behaviour = following(touchdown)
    assert behaviour.scheduled(BEGIN + hop.landing_time + late, touching) is event


def test_contacts_felt_before_the_apex_are_not_believed(following, hop):
    apex = BEGIN + (hop.take_off_time + hop.landing_time) / 2
    behaviour = following(Touchdown.CONTACT)
    assert behaviour.scheduled(apex - 0.002, TWO_DOWN) is None
    assert behaviour.scheduled(apex + 0.002, TWO_DOWN) is Event.TOUCHDOWN


@pytest.mark.parametrize(("late", "share"), [(-0.004, 1.0), (0.0, 1.0), (0.004, 0.0), (0.02, 0.0)])
def test_who_waits_for_a_contact_keeps_the_landing_pose_still(following, state_at, hop, late, share):
    v = hop.v.copy()
    v[-2:, JOINT_VELOCITY] = 3.0  # legs are drawn up as they land
    plan = dataclasses.replace(hop, v=v)
    target = following(Touchdown.CONTACT, plan).target(BEGIN + plan.landing_time + late, state_at())
    np.testing.assert_allclose(target.joint_velocity, share * 3.0)
    if late >= 0:
        np.testing.assert_allclose(target.joint_position, plan.landing_joint_position)


def test_to_follow_takes_a_plan(robot, gains):
    setting = Setting(robot=robot, gains=gains, home_height=0.25)
    with pytest.raises(ValueError, match="takes one"):
        FollowPlan(setting, Entry(Event.PLAN_ACCEPTED))


def test_a_plan_gives_its_sample_in_world_axes(hop, gains):
    turned = hop.placed(StartFrame(origin=np.array([1.0, 2.0, 0.0]), heading=0.5))
    sample = turned.sample(0.3)
    target = PlanTarget(turned.track, gains.follow).at(0.3)
    R = rotation.matrix(sample.q[3:7])
    np.testing.assert_allclose(target.body.angular_velocity, R @ sample.v[BASE_ANGULAR])
    np.testing.assert_allclose(target.body.com, sample.com)
    np.testing.assert_array_equal(target.joint_position, sample.q[7:])
    np.testing.assert_array_equal(target.force, sample.force)
    assert target.body.gains == gains.follow
    assert target.contact.all()


def test_who_waits_for_a_contact_keeps_the_joints_still(hop, gains):
    target = PlanTarget(hop.track, gains.follow)
    going, landing = target.at(0.3).joint_velocity.copy(), target.at(0.3, waiting=True)
    assert going.any()
    assert not landing.joint_velocity.any()
    assert not landing.joint_acceleration.any()
