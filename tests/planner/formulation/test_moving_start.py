"""Take-offs that begin in motion, on some of the contact points, and put others down elsewhere: checked by Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.robot.robot import GRAVITY
from aerial_planner.formulation import KinoDynamic, LiteralProblem, Variant
from aerial_planner.formulation.contacts import footholds, knot_contacts
from aerial_planner.ocp.options import SolverOptions

from .conftest import AHEAD, CLEARANCE, ON_REAR_FEET, SPEED, foot_positions

POSITION_TOLERANCE = 1e-4  # [m]
STATE_TOLERANCE = 1e-6  # SI units
MOMENTUM_TOLERANCE = 5e-4  # of a solution that is but a start [kg·m²/s]
VIOLATION = 1e-4  # SI units
ARRIVES = ON_REAR_FEET - 1  # knot from which the front feet rest where they will bear load


@pytest.fixture(scope="module")
def optimum(robot, running):
    stage = KinoDynamic(robot, running.model, running.settings, Variant.AAKD_STAR, SolverOptions())
    return stage.solve(running.schedule, running.reference, running.guess)


def test_a_body_leaves_the_ground_out_of_a_run(running):
    assert running.body_solution.converged
    np.testing.assert_allclose(running.guess.com_velocity[0], running.reference.x_0[3:6], atol=STATE_TOLERANCE)
    assert running.guess.com_velocity[0, 0] == pytest.approx(SPEED, abs=0.05)


def test_a_body_is_pushed_where_its_feet_stand(robot, running):
    guess, schedule, reference = running.guess, running.schedule, running.reference
    for k in range(len(schedule.contact)):
        acceleration = guess.force[k].sum(axis=0) / robot.mass - [0.0, 0.0, GRAVITY]
        time = schedule.dt * (np.arange(1000) + 0.5) / 1000
        com = guess.com[k] + np.outer(time, guess.com_velocity[k]) + 0.5 * np.outer(time**2, acceleration)
        levers = reference.foot_position[k][None] - com[:, None]
        gained = schedule.dt * np.cross(levers, guess.force[k]).sum(axis=1).mean(axis=0)
        np.testing.assert_allclose(
            guess.angular_momentum[k + 1] - guess.angular_momentum[k], gained, atol=MOMENTUM_TOLERANCE
        )


def test_the_motion_goes_on_from_its_start(robot, running, optimum):
    trajectory, solution = optimum
    assert solution.converged
    assert solution.max_violation < VIOLATION
    h = pin.computeCentroidalMomentum(robot.model, robot.model.createData(), running.start.q, running.start.v)
    np.testing.assert_allclose(robot.mass * trajectory.com_velocity[0], h.linear, atol=1e-5)
    np.testing.assert_allclose(trajectory.angular_momentum[0], h.angular, atol=1e-5)
    np.testing.assert_allclose(trajectory.joint_position[0], running.start.q[7:], atol=STATE_TOLERANCE)


def test_joints_go_on_at_the_rates_of_the_start(running, optimum):
    change = optimum[0].joint_velocity[0] - running.start.v[6:]
    rest = optimum[0].joint_velocity[0]
    assert np.linalg.norm(running.start.v[6:]) > 0.5
    assert np.linalg.norm(change[6:]) < np.linalg.norm(rest[6:])  # of the rear legs, which stand


def test_feet_that_stand_do_not_move(robot, running, optimum):
    feet = foot_positions(robot, optimum[0])[1:, ~running.front]
    np.testing.assert_allclose(
        feet, np.broadcast_to(running.reference.foot_position[0, ~running.front], feet.shape), atol=POSITION_TOLERANCE
    )


def test_feet_that_come_down_are_at_their_foothold_at_rest(robot, running, optimum):
    feet = foot_positions(robot, optimum[0])[:, running.front]
    foothold = robot.contact_positions(robot.standing_configuration())[running.front] + AHEAD
    np.testing.assert_allclose(feet[ARRIVES:], np.broadcast_to(foothold, feet[ARRIVES:].shape), atol=POSITION_TOLERANCE)
    assert np.abs(feet[ARRIVES - 1] - foothold).max() > CLEARANCE - POSITION_TOLERANCE


def test_feet_in_the_air_keep_their_clearance_and_push_nothing(robot, running, optimum):
    height = (foot_positions(robot, optimum[0]) - running.reference.foot_position)[..., 2]
    assert np.all(height[:ARRIVES, running.front] > CLEARANCE - POSITION_TOLERANCE)
    assert np.all(optimum[0].force[:ON_REAR_FEET, running.front] == 0.0)
    assert np.all(optimum[0].force[ON_REAR_FEET + 1 :, running.front, 2].mean(axis=0) > 1.0)


@pytest.mark.parametrize("variant", [Variant.AAKD_STAR])
def test_the_literal_formulation_agrees(robot, running, optimum, variant):
    problem = LiteralProblem(
        robot, running.model, running.settings, variant, running.schedule, running.reference, running.guess
    )
    assert problem.violation(optimum[0]) < VIOLATION
    assert problem.violation(running.guess) > VIOLATION


def test_contacts_say_who_is_held_loaded_and_arriving(running):
    contacts = knot_contacts(running.schedule)
    front, rear, everyone = (1, 1, 0, 0), (0, 0, 1, 1), (1, 1, 1, 1)
    assert contacts[0].held is None
    assert contacts[0].at_foothold == rear
    assert (contacts[1].held, contacts[1].loaded, contacts[1].at_foothold) == (rear, rear, rear)
    assert (contacts[ARRIVES].held, contacts[ARRIVES].loaded, contacts[ARRIVES].arriving) == (rear, rear, front)
    assert (contacts[ARRIVES + 1].held, contacts[ARRIVES + 1].loaded) == (rear, everyone)
    assert all(c.at_foothold == everyone for c in contacts[ARRIVES:])
    assert not any(any(c.arriving) for c in contacts[ARRIVES + 1 :])


def test_a_foot_that_leaves_or_arrives_is_at_the_foothold_it_leaves_or_comes_to(running):
    schedule, reference = running.schedule, running.reference
    moved = reference.foot_position.copy()
    moved[:ON_REAR_FEET] -= [1.0, 0.0, 0.0]  # what points in the air are above, before they come down
    at = footholds(schedule, type(reference)(**{**vars(reference), "foot_position": moved}))
    np.testing.assert_array_equal(at[ARRIVES, running.front], moved[ON_REAR_FEET, running.front])
    np.testing.assert_array_equal(at[ON_REAR_FEET, ~running.front], moved[ON_REAR_FEET, ~running.front])
    np.testing.assert_array_equal(at[1, running.front, 2], moved[1, running.front, 2] + CLEARANCE)
