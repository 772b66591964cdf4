"""Where a motion starts: standing robots at rest, moving ones with their velocities, all in the start heading frame."""

import dataclasses

import numpy as np
import pytest

from aerial_model.errors import ConfigurationError
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, BASE_POSITION, JOINT_VELOCITY, Robot
from aerial_model.values.contact_sequence import ContactSequence
from aerial_model.values.estimate import Estimate
from aerial_planner.motion.start import Start

from ..trot import moving, pair, sequence

HEADING = 2.0  # [rad]
PLACE = np.array([2.0, -1.0, 0.0])  # [m]


def elsewhere(estimate):
    """The state of a robot that does the same at another place with another heading."""
    q, turn = estimate.q.copy(), rotation.about_z(HEADING)
    q[BASE_POSITION] = rotation.matrix(turn) @ q[BASE_POSITION] + PLACE
    q[BASE_ORIENTATION] = rotation.multiply(turn, q[BASE_ORIENTATION])
    return dataclasses.replace(estimate, q=q)


def placed(phases):
    R = rotation.matrix(rotation.about_z(HEADING))
    moved = [dataclasses.replace(phase, foothold=phase.foothold @ R.T + PLACE) for phase in phases.phases]
    return ContactSequence(phases=tuple(moved))


@pytest.fixture
def trot(robot):
    """A trot on fr and hl, with the other pair to land ahead."""
    first, second = pair(robot, "fr", "hl"), pair(robot, "fl", "hr")
    estimate = moving(robot, 0.8, first)
    return estimate, sequence(robot, estimate.q, (0.12, first, 0.0), (0.14, second, 0.2))


def test_a_standing_robot_starts_from_rest_whatever_its_estimate_says(robot):
    estimate = Estimate(time=0.0, q=robot.standing_configuration(), v=np.full(robot.model.nv, 0.05))
    start = Start.at(robot, estimate)
    assert not start.v.any()
    assert start.contact.all()


def test_a_moving_start_is_the_same_wherever_it_is(robot, trot):
    here, there = Start.moving(robot, *trot), Start.moving(robot, elsewhere(trot[0]), placed(trot[1]))
    np.testing.assert_allclose(there.q, here.q, atol=1e-9)
    np.testing.assert_array_equal(there.v, here.v)
    for a, b in zip(there.sequence.phases, here.sequence.phases, strict=True):
        np.testing.assert_allclose(a.foothold, b.foothold, atol=1e-9)


def test_the_frame_of_a_moving_start_is_under_the_points_that_bear_load(robot, trot):
    start = Start.moving(robot, *trot)
    loaded = robot.contact_positions(start.q)[start.contact]
    np.testing.assert_allclose(loaded.mean(axis=0), [0.0, 0.0, robot.contact_points[0].radius], atol=1e-9)


def test_points_that_bear_load_already_stand_where_they_are(robot, trot):
    estimate, phases = trot
    drifted = [dataclasses.replace(phase, foothold=phase.foothold + [0.01, 0.0, 0.0]) for phase in phases.phases]
    start = Start.moving(robot, estimate, ContactSequence(phases=tuple(drifted)))
    first, second = start.sequence.phases
    points = robot.contact_positions(start.q)
    np.testing.assert_allclose(first.foothold[start.contact], points[start.contact], atol=1e-12)
    expected = Start.moving(robot, *trot).sequence.phases[1].foothold[~start.contact] + [0.01, 0.0, 0.0]
    np.testing.assert_allclose(second.foothold[~start.contact], expected, atol=1e-12)


def test_joints_that_plans_leave_at_home_are_left_out():
    robot = Robot.load("mit_humanoid")
    held = np.zeros(robot.n_joints, dtype=bool)
    held[3] = True
    start = Start.standing(robot)
    moved = dataclasses.replace(start, v=np.arange(robot.model.nv, dtype=float))
    reduced = moved.planned(dataclasses.replace(robot, held_joints=held))
    np.testing.assert_array_equal(reduced.v, np.delete(moved.v, JOINT_VELOCITY.start + 3))
    assert len(reduced.q) == len(start.q) - 1


def test_a_sequence_for_another_number_of_points_is_refused(robot, trot):
    fewer = [
        dataclasses.replace(phase, contact=phase.contact[:3], foothold=phase.foothold[:3]) for phase in trot[1].phases
    ]
    with pytest.raises(ConfigurationError, match="expected 4 contact points of mini_cheetah, found 3"):
        Start.moving(robot, trot[0], ContactSequence(phases=tuple(fewer)))


def test_a_take_off_without_contact_in_between_is_refused(robot, trot):
    first, second = trot[1].phases
    flight = dataclasses.replace(first, contact=np.zeros(4, dtype=bool))
    with pytest.raises(ConfigurationError, match="no point bears load in phase 2 of 3"):
        Start.moving(robot, trot[0], ContactSequence(phases=(first, flight, second)))


def test_a_loaded_point_far_from_its_foothold_is_named(robot, trot):
    first, second = trot[1].phases
    far = dataclasses.replace(first, foothold=first.foothold + [0.0, 0.2, 0.0])
    with pytest.raises(ConfigurationError, match=r"point (fr|hl) bears load 0\.200 m from its foothold"):
        Start.moving(robot, trot[0], ContactSequence(phases=(far, second)))
