"""What the next attempt at a plan is asked for, given what the last one asks of the actuators."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from aerial_planner.formulation.limits import Margin, Variant
from aerial_planner.kinematics.base_frame import base_frame_model
from aerial_planner.kinematics.inverse_kinematics import InverseKinematics
from aerial_planner.motion.motion import load_motion
from aerial_planner.motion.schedule import contact_schedule
from aerial_planner.motion.start import Start
from aerial_planner.reference.body import body_reference
from aerial_planner.refinement import Attempt, Outcome

from .conftest import jump

JOINT = 4


@pytest.fixture(scope="module")
def outcome(planner):
    """Of a jump that leaves nothing to be wished."""
    request, robot, settings = jump(0.3, 0.0), planner.robot, planner.settings
    result, model = planner.plan(request), base_frame_model(robot)
    schedule = contact_schedule(request, load_motion("jump", robot), robot, settings.dt, settings.flight_knots)
    stance, ik = Start.standing(robot), InverseKinematics(robot, model)
    return Outcome(
        attempt=Attempt(request=request, margin=Margin.usual(robot, settings)),
        from_a_plan=True,
        schedule=schedule,
        reference=body_reference(schedule, stance, robot, model, ik, settings),
        solution=SimpleNamespace(max_violation=0.0),
        plan=result.plan,
        use=result.actuator_use,
    )


def asked(outcome, ratio, *, flying):
    """The outcome with another use of the actuators: ``JOINT`` was asked for a ratio of its torque once, in flight or before."""
    torque_ratio = outcome.use.torque_ratio.copy()
    torque_ratio[int(np.argmax(outcome.use.flying)) if flying else 3, JOINT] = ratio
    return outcome._replace(use=dataclasses.replace(outcome.use, torque_ratio=torque_ratio))


def improved(planner, outcome, variant=Variant.AAKD_STAR):
    return outcome.attempt.improved(outcome, planner.robot, planner.settings, variant)


def test_a_good_plan_is_left_alone(planner, outcome):
    assert improved(planner, outcome) is None


def test_only_the_limit_of_the_joint_that_was_asked_for_too_much_is_lowered(planner, outcome):
    usual = outcome.attempt.margin
    better = improved(planner, asked(outcome, 1.2, flying=False))
    assert better.margin.take_off[JOINT] == pytest.approx(usual.take_off[JOINT] * 0.98 * 0.95 / 1.2)
    np.testing.assert_array_equal(np.delete(better.margin.take_off, JOINT), np.delete(usual.take_off, JOINT))
    np.testing.assert_array_equal(better.margin.flight, usual.flight)


def test_at_first_another_start_is_all_that_is_tried(planner, outcome):
    better = improved(planner, asked(outcome, 1.2, flying=False)._replace(from_a_plan=False))
    np.testing.assert_array_equal(better.margin.take_off, outcome.attempt.margin.take_off)


def test_without_actuator_limits_nothing_is_asked_for(planner, outcome):
    assert improved(planner, asked(outcome, 5.0, flying=False), Variant.KD) is None


def test_legs_first_fold_more_slowly_then_leave_the_ground_slower(planner, outcome):
    tried = asked(outcome, 3.0, flying=True)
    slower = improved(planner, tried)
    path = outcome.reference.flight_path
    assert slower.folding_time > path.settling_time
    np.testing.assert_array_equal(slower.margin.flight, outcome.attempt.margin.flight)
    slowest = dataclasses.replace(slower, folding_time=outcome.schedule.flight_time)
    last = improved(planner, tried._replace(attempt=slowest))
    assert last.folding_time == slowest.folding_time
    assert last.margin.flight[JOINT] == pytest.approx(planner.settings.margin * 0.98 * 0.95 / 3.0)


def test_after_some_rounds_a_little_less_room_is_good_enough(planner, outcome):
    nearly = asked(outcome, 1.0, flying=False)
    assert improved(planner, nearly) is not None
    tired = dataclasses.replace(outcome.attempt, rounds=3)
    assert improved(planner, nearly._replace(attempt=tired)) is None


def test_improvements_come_to_an_end(planner, outcome):
    attempt = outcome.attempt
    while attempt is not None:
        tried, attempt = attempt, improved(planner, asked(outcome, 9.0, flying=False)._replace(attempt=attempt))
    assert tried.number == 12
