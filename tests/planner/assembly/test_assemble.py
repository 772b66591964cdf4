"""Plans against physics: what is checked here is recomputed from the plan alone."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.errors import InvalidPlanError
from aerial_model.numerics import rotation
from aerial_model.robot.contact import friction_pyramid
from aerial_model.robot.robot import BASE_ORIENTATION
from aerial_model.values.frame import StartFrame
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import Terrain

from ..conftest import jump

G = np.array([0.0, 0.0, -9.81])
POSITION_TOLERANCE = 1e-4  # [m]
FOOT_TOLERANCE = 0.01  # of the landing feet's centre: they hang from a body that may be half a degree off level [m]
FORCE_FROM_NOWHERE = 0.1  # of the weight; with (3.8) at the knots a roll needed 0.33
MOMENTUM_TOLERANCE = 1e-4  # [kg·m²/s]
REFUSAL_ITERATIONS = 80  # that a refusal may take; an iteration is some 15 ms

GOALS = [
    ("forward", jump(0.3, 0.0)),
    ("far forward", jump(1.0, 0.0)),
    ("backward", jump(-0.2, 0.0)),
    ("left", jump(0.0, 0.2)),
    ("right", jump(0.0, -0.4)),
    ("oblique", jump(-0.3, 0.3)),
    ("up", jump(0.0, 0.0)),
    ("turning", jump(0.2, 0.1, yaw=0.8)),
    ("quarter turn", jump(0.0, 0.0, yaw=-np.pi / 2)),
    ("onto a platform", jump(0.6, 0.0, 0.16, terrain=Terrain.platform(0.16, 0.3, 0.0))),
    ("off a platform", jump(0.7, 0.0, -0.16, terrain=Terrain.platform(-0.16, 0.24, 0.0))),
    ("roll", MotionRequest(motion="barrel_roll", displacement=np.array([0.0, -0.2, 0.0]))),
]


@pytest.mark.parametrize("motion", ["spin", "barrel_roll", "front_flip"])
def test_the_accelerations_of_a_turning_motion_need_no_force_from_nowhere(planner, motion):
    use = planner.plan(MotionRequest(motion=motion)).actuator_use
    assert use.base_wrench_error < FORCE_FROM_NOWHERE


@pytest.mark.parametrize("turns", [1.0, -1.0])
def test_feet_that_have_left_the_ground_keep_clear_of_it_while_others_push(planner, turns):
    plan = planner.plan(MotionRequest(motion="barrel_roll", rotation=turns)).plan
    settings, step = planner.settings, plan.time[1]
    lifted = np.cumsum(~plan.contact, axis=0) * step > settings.swing_rise_time + 1.5 * step
    pushing = plan.contact.any(axis=1)
    rise = (plan.foot_position - plan.foot_position[0])[..., 2]
    assert np.any(lifted & pushing[:, None])
    assert np.all(rise[lifted & pushing[:, None]] > settings.swing_clearance - POSITION_TOLERANCE)


@pytest.mark.parametrize("motion", ["barrel_roll", "front_flip"])
def test_a_foot_leaves_the_ground_from_rest(planner, robot, motion):
    plan = planner.plan(MotionRequest(motion=motion)).plan
    data = robot.model.createData()
    leaving = plan.contact[:-1] & ~plan.contact[1:]
    assert leaving.all(axis=1).sum() == 0
    assert np.all(leaving.any(axis=0))
    for k, i in np.argwhere(leaving):
        pin.forwardKinematics(robot.model, data, plan.q[k + 1], plan.v[k + 1])
        frame = robot.contact_frames[i]
        velocity = pin.getFrameVelocity(robot.model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear
        np.testing.assert_allclose(velocity, 0.0, atol=1e-6)


@pytest.fixture(scope="module", params=GOALS, ids=lambda goal: goal[0])
def case(request, planner):
    wanted = request.param[1]
    return wanted, planner.plan(wanted)


def test_a_plan_is_consistent_and_for_this_robot(case, robot):
    plan = case[1].plan
    assert plan.checked(robot) is plan
    assert (plan.robot, plan.model_hash) == (robot.name, robot.model_hash)


def test_the_ballistic_path_brings_the_feet_to_the_goal(case):
    wanted, result = case
    plan = result.plan
    k = np.searchsorted(plan.time, plan.take_off_time - 1e-9)
    T = plan.landing_time - plan.take_off_time
    landing = plan.com[k] + plan.com_velocity[k] * T + 0.5 * G * T**2
    np.testing.assert_allclose(landing, plan.com[-1], atol=POSITION_TOLERANCE)
    feet = plan.foot_position[-1].mean(axis=0)
    np.testing.assert_allclose(feet[:2], wanted.displacement[:2], atol=FOOT_TOLERANCE)
    assert landing[2] - wanted.displacement[2] == pytest.approx(plan.landing_com_height, abs=POSITION_TOLERANCE)


def test_the_reported_landing_position_is_where_forward_kinematics_puts_the_feet_at_touchdown(case, robot):
    """It is a figure of the plan, not the goal: it misses that by as much as the feet do."""
    wanted, result = case
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, result.plan.q[-1])
    feet = np.mean([data.oMf[frame].translation for frame in robot.contact_frames], axis=0)
    reported = np.array(result.report.landing_position_m)
    np.testing.assert_allclose(reported, feet - [0.0, 0.0, 0.004], atol=1e-12)
    np.testing.assert_allclose(reported, wanted.displacement, atol=FOOT_TOLERANCE)
    assert not np.array_equal(reported, wanted.displacement)


def test_the_landing_feet_stand_on_the_landing_surface(case):
    wanted, result = case
    heights = result.plan.foot_position[-1, :, 2] - 0.004
    np.testing.assert_allclose(heights, wanted.displacement[2], atol=5e-3)


def test_forces_move_the_centre_of_mass_and_its_momentum_as_planned(case, robot):
    plan = case[1].plan
    for k in range(np.searchsorted(plan.time, plan.take_off_time - 1e-9)):
        dt = plan.time[k + 1] - plan.time[k]
        force = plan.force[k].sum(axis=0)
        acceleration = force / robot.mass + G
        mean_com = plan.com[k] + dt / 2 * plan.com_velocity[k] + dt**2 / 6 * acceleration
        moment = np.cross(plan.foot_position[k] - mean_com, plan.force[k]).sum(axis=0)
        v = plan.com_velocity[k] + acceleration * dt
        np.testing.assert_allclose(plan.com_velocity[k + 1], v, atol=POSITION_TOLERANCE)
        np.testing.assert_allclose(
            plan.angular_momentum[k + 1], plan.angular_momentum[k] + moment * dt, atol=MOMENTUM_TOLERANCE
        )


def test_forces_stay_in_the_friction_pyramid(case, robot):
    plan = case[1].plan
    W = friction_pyramid(robot.friction_coefficient)
    assert np.min(plan.force @ W.T) > -1e-3
    assert np.all(plan.force[~plan.contact] == 0.0)


def test_feet_in_contact_do_not_move(case):
    plan = case[1].plan
    held = np.repeat(plan.contact[:, :, None], 3, axis=2)
    drift = np.where(held, plan.foot_position - plan.foot_position[0], 0.0)
    assert np.abs(drift).max() < POSITION_TOLERANCE


def test_velocities_carry_the_planned_momentum(case, robot):
    plan = case[1].plan
    data = robot.model.createData()
    for q, v, com_velocity, alpha in zip(plan.q, plan.v, plan.com_velocity, plan.angular_momentum, strict=True):
        h = pin.computeCentroidalMomentum(robot.model, data, q, v)
        np.testing.assert_allclose(h.linear, robot.mass * com_velocity, atol=1e-6)
        np.testing.assert_allclose(h.angular, alpha, atol=1e-6)


def test_the_robot_lands_level_at_the_goal_heading(case):
    wanted, result = case
    miss = rotation.multiply(rotation.about_z(-wanted.yaw), result.plan.q[-1, BASE_ORIENTATION])
    assert np.rad2deg(np.linalg.norm(rotation.log(miss))) < 3.0
    if wanted.motion == "jump":  # else the turn about another axis shares in the sum about this one
        assert result.report.rotation_deg[2] == pytest.approx(np.rad2deg(wanted.yaw), abs=5.0)


def test_exact_torques_are_within_the_limits(case):
    report = case[1].report
    assert report.peak_torque_ratio <= 1.05
    assert report.peak_voltage_ratio <= 1.05
    assert report.peak_speed_ratio <= 1.0


def test_a_sampled_plan_is_continuous(forward):
    plan = forward.plan
    step = 1e-6
    for time in np.linspace(0.01, plan.landing_time - 0.01, 37):
        here, next_ = plan.sample(time), plan.sample(time + step)
        np.testing.assert_allclose(next_.com, here.com, atol=10 * step)
        np.testing.assert_allclose(next_.q, here.q, atol=100 * step)


def test_a_placed_plan_is_the_same_motion_elsewhere(forward, robot):
    plan = forward.plan
    moved = plan.placed(StartFrame(origin=np.array([1.0, 2.0, 0.3]), heading=0.7)).checked(robot)
    back = moved.placed(StartFrame(heading=-0.7))
    shift = rotation.matrix(rotation.about_z(-0.7)) @ np.array([1.0, 2.0, 0.3])
    np.testing.assert_allclose(back.com - shift, plan.com, atol=1e-12)
    np.testing.assert_allclose(
        moved.foot_position[5], [robot.contact_positions(moved.q[5])[i] for i in range(4)], atol=1e-6
    )


@pytest.mark.parametrize("field", ["q", "v", "com", "force", "foot_position", "landing_joint_position"])
def test_a_plan_with_a_nan_is_refused_by_name(forward, robot, field):
    value = np.array(getattr(forward.plan, field))
    value.flat[3] = np.nan
    with pytest.raises(InvalidPlanError, match=f"plan field {field}: not finite"):
        dataclasses.replace(forward.plan, **{field: value}).checked(robot)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"model_hash": "other"}, "plan is for robot"),
        ({"take_off_time": 5.0}, "take_off_time < landing_time"),
        ({"landing_yaw": float("inf")}, "landing_yaw: expected a finite number"),
        ({"com": np.zeros((2, 3))}, "plan field com: expected shape"),
        ({"time": np.zeros(3)}, "plan field q: expected shape"),
    ],
)
def test_an_inconsistent_plan_is_refused(forward, robot, change, sentence):
    with pytest.raises(InvalidPlanError, match=sentence):
        dataclasses.replace(forward.plan, **change).checked(robot)
