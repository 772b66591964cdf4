"""Optimized phase durations: within the motion's range, never dearer than fixed ones, and plans like any other."""

import dataclasses

import numpy as np
import pytest

from aerial_model.config import from_mapping
from aerial_model.errors import ConfigurationError
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, JOINT_POSITION, JOINT_VELOCITY
from aerial_model.values.request import MotionRequest
from aerial_planner.assembly.library import PlanLibrary
from aerial_planner.motion.motion import Phase, load_motion
from aerial_planner.motion.schedule import contact_schedule
from aerial_planner.motion.start import Start
from aerial_planner.reference.body import body_reference
from aerial_planner.settings import PlannerSettings

from .conftest import jump

MOMENTUM_TOLERANCE = 1e-4  # [kg·m²/s]
COST_TOLERANCE = 1e-3  # of the solver
FORWARD = jump(0.6, 0.0, optimize_timing=True)
FLIP = MotionRequest(motion="front_flip", optimize_timing=True)


@pytest.fixture(scope="module", params=[FORWARD, FLIP], ids=["jump", "flip"])
def timed(request, planner):
    return request.param, planner.plan(request.param)


def test_each_phase_lasts_as_long_as_its_motion_permits(timed, robot):
    wanted, result = timed
    plan, ends = result.plan, [0.0]
    for phase in load_motion(wanted.motion, robot).take_off:
        least, greatest = phase.duration_range
        N = round(phase.duration / PlannerSettings().dt)
        first = np.argmin(np.abs(plan.time - ends[-1]))
        steps = np.diff(plan.time[first : first + N + 1])
        np.testing.assert_allclose(steps, steps[0], rtol=1e-6)
        assert least - 1e-6 <= N * steps[0] <= greatest + 1e-6
        assert N * steps[0] != pytest.approx(phase.duration, abs=1e-3)
        ends.append(plan.time[first + N])
    assert plan.take_off_time == pytest.approx(ends[-1])


def test_the_knots_obey_the_equations_of_motion_in_their_own_time(timed, robot):
    plan = timed[1].plan
    for k in range(np.argmin(np.abs(plan.time - plan.take_off_time))):
        dt = plan.time[k + 1] - plan.time[k]
        acceleration = plan.force[k].sum(axis=0) / robot.mass - [0, 0, 9.81]
        mean_com = plan.com[k] + dt / 2 * plan.com_velocity[k] + dt**2 / 6 * acceleration
        moment = np.cross(plan.foot_position[k] - mean_com, plan.force[k]).sum(axis=0)
        gained = plan.com_velocity[k + 1] - plan.com_velocity[k]
        np.testing.assert_allclose(gained, acceleration * dt, atol=1e-4)
        turned = plan.angular_momentum[k + 1] - plan.angular_momentum[k]
        np.testing.assert_allclose(turned, moment * dt, atol=MOMENTUM_TOLERANCE)


def test_joint_rates_are_those_of_the_stretched_time(timed):
    plan = timed[1].plan
    N = int(np.argmin(np.abs(plan.time - plan.take_off_time)))
    rates = np.diff(plan.q[: N + 1, JOINT_POSITION], axis=0) / np.diff(plan.time[: N + 1])[:, None]
    between = 0.5 * (plan.v[:N, JOINT_VELOCITY] + plan.v[1 : N + 1, JOINT_VELOCITY])
    assert np.abs(rates - between).max() < 5.0  # [rad/s]; half a step's acceleration


def test_a_timed_flip_lands_level(timed):
    assert np.rad2deg(rotation.tilt(timed[1].plan.landing_pose[BASE_ORIENTATION])) < 3.0


def test_no_fixed_duration_is_cheaper(planner, robot, timed):
    wanted, result = timed
    stages, settings, start = planner._stages, planner.settings, Start.standing(robot)
    stage = stages.kino_dynamic(wanted)
    schedule = contact_schedule(wanted, load_motion(wanted.motion, robot), robot, settings.dt, settings.flight_knots)
    reference = body_reference(schedule, start, robot, stages.model, stages.ik, settings)
    guess, _ = stages.srbm.solve(schedule, reference)
    for stretch in (0.8, 1.0, 1.2):
        fixed = np.tile([stretch - 1e-4, stretch + 1e-4], (len(schedule.contact), 1))
        _, solution = stage.solve(dataclasses.replace(schedule, stretch_range=fixed), reference, guess)
        assert solution.converged
        assert solution.cost >= result.report.cost - COST_TOLERANCE


def test_timing_is_fixed_unless_asked_for(forward):
    assert forward.plan.take_off_time == pytest.approx(0.4, abs=1e-12)


@pytest.mark.parametrize("duration_range", [[0.5, 0.6], [0.0, 0.5], [0.4, 0.3]])
def test_a_range_that_its_duration_is_not_in_is_an_error(duration_range):
    phase = {"contacts": "all", "duration": 0.4, "duration_range": duration_range}
    with pytest.raises(ConfigurationError, match="least ≤ duration ≤ greatest"):
        from_mapping(Phase, phase, "jump.yaml: take_off[0]")


def test_a_misspelt_key_of_a_phase_is_an_error():
    with pytest.raises(ConfigurationError, match=r"take_off\[0\]: unknown key 'duraton' \(did you mean 'duration'"):
        from_mapping(Phase, {"contacts": "all", "duraton": 0.4}, "jump.yaml: take_off[0]")


def test_a_library_takes_and_gives_timed_plans(planner, robot, timed, tmp_path):
    wanted, result = timed
    planner.plans = PlanLibrary(tmp_path, robot, pytest.fail)
    planner.plans.add(result.plan)
    try:
        for optimize_timing in (True, False):
            report = planner.plan(dataclasses.replace(wanted, optimize_timing=optimize_timing)).report
            assert report.started_from == "library"
    finally:
        planner.plans = None
