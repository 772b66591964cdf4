"""Plans that begin in motion, recomputed from the plan alone and by MuJoCo."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from aerial_evaluation.judgement.verification import verify
from aerial_model.errors import RefusalCode, RefusalError
from aerial_planner.motion.start import Start

from .conftest import jump
from .trot import moving, pair, sequence

SPEED = 0.4  # of the jump on all feet [m/s]
TROT_SPEED = 0.8  # [m/s]
FIRST, SECOND = 0.12, 0.14  # phases of a take-off from a trot [s]
STATE_TOLERANCE = 1e-9
POSITION_TOLERANCE = 1e-4  # [m]
REST_TOLERANCE = 1e-6  # [m/s]
LANDING_TOLERANCE = 0.01  # of the feet's centre [m]
G = np.array([0.0, 0.0, -9.81])


@pytest.fixture(scope="module")
def gliding(planner, robot):
    """A forward jump on all feet of a robot whose trunk moves already."""
    every = np.ones(robot.n_contacts, dtype=bool)
    estimate = moving(robot, SPEED, every)
    start = Start.moving(robot, estimate, sequence(robot, estimate.q, (0.3, every, 0.0)))
    return start, planner.plan(jump(0.5, 0.0), start).plan


@pytest.fixture(scope="module")
def trotting(planner, robot):
    """A jump from a trot: on one diagonal pair, then on the other one at new footholds."""
    first, second = pair(robot, "fr", "hl"), pair(robot, "fl", "hr")
    estimate = moving(robot, TROT_SPEED, first, ahead=TROT_SPEED * FIRST / 2)
    ahead = TROT_SPEED * (FIRST / 2 + FIRST + SECOND)
    phases = sequence(robot, estimate.q, (FIRST, first, 0.0), (SECOND, second, ahead))
    start = Start.moving(robot, estimate, phases)
    return start, planner.plan(jump(0.7, 0.0), start).plan


@pytest.fixture(params=["gliding", "trotting"])
def case(request):
    return request.getfixturevalue(request.param)


def test_the_first_row_is_the_state_the_motion_starts_from(case):
    start, plan = case
    np.testing.assert_allclose(plan.q[0], start.q, atol=STATE_TOLERANCE)
    np.testing.assert_array_equal(plan.v[0], start.v)


def test_the_forces_integrated_from_the_start_state_end_at_the_goal(case, robot):
    """From the state of the centre of mass that Pinocchio finds in the start, step by step of constant force."""
    start, plan = case
    data = robot.model.createData()
    momentum = pin.computeCentroidalMomentum(robot.model, data, start.q, start.v)
    r, v, alpha = data.com[0].copy(), momentum.linear / robot.mass, momentum.angular.copy()
    N = np.searchsorted(plan.time, plan.take_off_time - 1e-9)
    for k in range(N):
        dt, force = plan.time[k + 1] - plan.time[k], plan.force[k]
        acceleration = force.sum(axis=0) / robot.mass + G
        mean = r + dt / 2 * v + dt**2 / 6 * acceleration
        alpha = alpha + dt * np.cross(plan.foot_position[k] - mean, force).sum(axis=0)
        r, v = r + dt * v + dt**2 / 2 * acceleration, v + dt * acceleration
    T = plan.landing_time - plan.take_off_time
    np.testing.assert_allclose(r + T * v + T**2 / 2 * G, plan.com[-1], atol=1e-3)
    np.testing.assert_allclose(alpha, plan.angular_momentum[-1], atol=1e-3)
    feet = robot.contact_positions(plan.q[-1]).mean(axis=0)
    np.testing.assert_allclose(feet[:2], plan.landing_support_centre[:2], atol=LANDING_TOLERANCE)


def test_mujoco_flies_it_to_the_goal(case, robot):
    assert verify(robot, case[1]).passed


def test_loaded_feet_are_on_their_footholds_at_rest_in_each_phase(trotting, robot):
    start, plan = trotting
    data = robot.model.createData()
    begin = 0.0
    for phase in start.sequence.phases:
        inside = (plan.time > begin - 1e-9) & (plan.time < begin + phase.duration + 1e-9) & (plan.time > 0)
        for k in np.flatnonzero(inside):
            np.testing.assert_allclose(
                plan.foot_position[k, phase.contact], phase.foothold[phase.contact], atol=POSITION_TOLERANCE
            )
            pin.forwardKinematics(robot.model, data, plan.q[k], plan.v[k])
            for i in np.flatnonzero(phase.contact):
                velocity = pin.getFrameVelocity(robot.model, data, robot.contact_frames[i], pin.LOCAL_WORLD_ALIGNED)
                np.testing.assert_allclose(velocity.linear, 0.0, atol=REST_TOLERANCE)
        begin += phase.duration


def test_the_plan_tells_its_contact_sequence(trotting):
    start, plan = trotting
    *take_off, flight = plan.contact_sequence.phases
    assert not flight.contact.any()
    assert flight.duration == pytest.approx(plan.landing_time - plan.take_off_time)
    for planned, given in zip(take_off, start.sequence.phases, strict=True):
        assert planned.duration == pytest.approx(given.duration)
        np.testing.assert_array_equal(planned.contact, given.contact)
        np.testing.assert_allclose(
            planned.foothold[given.contact], given.foothold[given.contact], atol=POSITION_TOLERANCE
        )


def test_half_a_cycle_of_a_fast_trot_is_enough_for_a_jump_of_a_metre(planner, robot):
    loaded = pair(robot, "fr", "hl")
    estimate = moving(robot, 1.5, loaded, ahead=1.5 * 0.13 / 2)
    start = Start.moving(robot, estimate, sequence(robot, estimate.q, (0.13, loaded, 0.0)))
    plan = planner.plan(jump(1.0, 0.0), start).plan
    assert plan.take_off_time == pytest.approx(0.13)


def test_the_timing_of_a_given_sequence_is_not_optimized(planner, robot, trotting):
    with pytest.raises(RefusalError, match="contact sequence is given") as refusal:
        planner.plan(dataclasses.replace(jump(0.7, 0.0), optimize_timing=True), trotting[0])
    assert refusal.value.code is RefusalCode.INVALID_REQUEST
