"""The reference of a motion: where body, feet and legs should roughly be, of light-legged robots and of one that is not."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.kinematics.base_frame import base_frame_model
from aerial_planner.kinematics.inverse_kinematics import InverseKinematics
from aerial_planner.motion.motion import load_motion
from aerial_planner.motion.schedule import contact_schedule
from aerial_planner.motion.start import Start
from aerial_planner.reference.body import body_reference
from aerial_planner.settings import PlannerSettings

from ..trot import moving, pair, sequence

GOALS = [(0.0, 0.0, 0.0), (0.52, 0.0, 0.0), (0.0, 0.3, 0.0), (-0.2, 0.0, 0.0)]


@pytest.fixture(scope="module", params=["mini_cheetah", "mit_humanoid"])
def a_robot(request):
    robot = Robot.load(request.param)
    return robot, base_frame_model(robot)


def jump(robot, model, displacement):
    schedule = schedule_of(robot, "jump", displacement)
    return schedule, reference_of(robot, model, schedule)


def schedule_of(robot, motion, displacement):
    settings = robot.section("planner", PlannerSettings)
    request = MotionRequest(motion=motion, displacement=np.array(displacement))
    return contact_schedule(request, load_motion(motion, robot), robot, settings.dt, settings.flight_knots)


def reference_of(robot, model, schedule):
    settings, ik = robot.section("planner", PlannerSettings), InverseKinematics(robot, model)
    return body_reference(schedule, Start.standing(robot), robot, model, ik, settings)


def drawn_up(robot, pose, rate):
    """Velocity of the contact points ``(n_c, 3)`` from the centre of mass of a level robot."""
    model, data = robot.model, robot.model.createData()
    q, v = np.concatenate([np.zeros(6), [1.0], pose]), np.concatenate([np.zeros(6), rate])
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    com = pin.jacobianCenterOfMass(model, data, q)
    J = [pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED)[:3] - com for f in robot.contact_frames]
    return np.array(J) @ v


@pytest.mark.parametrize("displacement", GOALS, ids=str)
def test_feet_meet_the_ground_drawn_up_by_the_part_of_the_fall_that_their_impact_takes(displacement):
    robot = Robot.load("mit_humanoid")
    schedule, reference = jump(robot, base_frame_model(robot), displacement)
    T = schedule.flight_time
    position, rate = reference.flight_path.at(robot.poses["home"], np.array([T - 1e-9]), T)
    np.testing.assert_allclose(position[0], reference.landing_joint_position, atol=1e-6)
    velocity = drawn_up(robot, position[0], rate[0])
    fall = 0.5 * 9.81 * T - (reference.landing_com[2] - 1.1 * reference.x_0[2]) / T
    np.testing.assert_allclose(velocity[:, :2], 0.0, atol=0.03 * fall)
    np.testing.assert_allclose(velocity[:, 2], velocity[:, 2].mean(), atol=0.02 * fall)
    q = np.concatenate([np.zeros(6), [1.0], position[0]])
    legs = pin.crba(robot.model, robot.model.createData(), q)[6:, 6:]
    mu = rate[0] @ legs @ rate[0] / velocity[:, 2].mean() ** 2 / robot.mass
    assert velocity[:, 2].mean() == pytest.approx(mu / (1 + mu) * fall, rel=0.1)


def test_feet_of_light_legs_are_at_rest_when_they_meet_the_ground():
    robot = Robot.load("mini_cheetah")
    _, reference = jump(robot, base_frame_model(robot), GOALS[1])
    np.testing.assert_array_equal(reference.flight_path.reach, reference.flight_path.landing)


def test_what_stops_the_fall_of_a_flip_stops_its_turn(a_robot):
    """Feet of a short support are set off by the angular momentum over the impulse; a long one stays where it is."""
    robot, model = a_robot
    flip = schedule_of(robot, "back_flip", (-0.6, 0.0, -0.4))
    turning = reference_of(robot, model, flip)
    straight = reference_of(robot, model, dataclasses.replace(flip, rotation=np.zeros(3)))
    aside = straight.landing_com[0] - turning.landing_com[0]
    height, T = turning.landing_com_height, flip.flight_time
    way = flip.landing_centre[2] + height - 1.1 * turning.x_0[2]
    fall = 0.5 * 9.81 * T - way / T
    alpha = np.array(model.inertia(robot.poses["home"]))[1, 1] * 2 * np.pi * (1 - flip.rotation_at_lift_off) / T
    impulse = robot.mass * (fall + 0.4 * np.sqrt(9.81 * height))
    # Backward: what pushes the feet from behind the centre of mass turns the body forward.
    assert aside == pytest.approx(-alpha / impulse if robot.name == "mit_humanoid" else 0.0, abs=1e-3)


def test_legs_that_nothing_lets_meet_the_ground_softly_are_bent_and_not_swung():
    robot = Robot.load("mit_humanoid")
    flip = schedule_of(robot, "back_flip", (-0.6, 0.0, -0.4))
    reference = reference_of(robot, base_frame_model(robot), flip)
    T = flip.flight_time
    _, rate = reference.flight_path.at(robot.poses["home"], np.array([T - 1e-9]), T)
    assert np.abs(rate / robot.actuators.no_load_speed).max() < 0.8
    knees = [i for i, name in enumerate(robot.joint_names) if "knee" in name]
    assert np.all(reference.landing_joint_position[knees] > 0.6)  # straight they were at 0.3


@pytest.mark.parametrize("displacement", GOALS, ids=str)
def test_legs_keep_to_their_range_and_speed_on_the_way(a_robot, displacement):
    robot, model = a_robot
    schedule, reference = jump(robot, model, displacement)
    path, T = reference.flight_path, schedule.flight_time
    position, rate = path.at(robot.poses["home"], np.linspace(0.5, 1.0, 200) * T, T)
    low, high = robot.planning_range
    assert np.all(position >= low - 1e-9)
    assert np.all(position <= high + 1e-9)
    assert np.all(np.abs(rate) < 0.65 * robot.actuators.no_load_speed)


def test_legs_that_must_fold_slowly_accelerate_less(a_robot):
    robot, model = a_robot
    schedule, usual = jump(robot, model, GOALS[1])
    slow = reference_of(robot, model, dataclasses.replace(schedule, folding_time=0.7 * schedule.flight_time))
    start, rate, T = robot.poses["home"], np.full(robot.n_joints, 5.0), schedule.flight_time
    times = np.linspace(0.0, T, 400)
    greatest = []
    for path in (usual.flight_path, slow.flight_path):
        position, velocity = path.from_take_off(start, rate, times, T)
        np.testing.assert_allclose(position[0], start)
        np.testing.assert_allclose(velocity[0], rate)
        np.testing.assert_allclose(position[-1], path.landing, atol=1e-9)
        a, b = path.onset(T)
        acceleration = np.diff(velocity, axis=0) / np.diff(times)[:, None]
        np.testing.assert_allclose(acceleration[0], -a * rate + b / T**2 * (path.tuck - start), rtol=0.1, atol=5.0)
        greatest.append(np.abs(acceleration[:200]).max())
    assert greatest[1] < 0.5 * greatest[0]


def test_the_support_is_set_farther_ahead_of_a_faster_robot(a_robot):
    robot, model = a_robot
    schedule, usual = jump(robot, model, GOALS[1])
    faster = dataclasses.replace(schedule, landing_speed=usual.landing_speed + 0.5)
    moved = usual.landing_com - reference_of(robot, model, faster).landing_com
    assert moved[0] == pytest.approx(0.5 * usual.landing_lead_time, abs=1e-6)
    assert (usual.landing_lead_time > 0) == (robot.name == "mit_humanoid")  # the other's feet are far apart


def test_arms_that_shift_the_centre_of_mass_leave_the_feet_where_they_are_to_land(a_robot):
    """``landing_com`` is that with the arms where they are; the legs reach out so that it is as far behind the feet as usual."""
    robot, model = a_robot
    schedule, usual = jump(robot, model, GOALS[1])
    shift = np.array([0.02, 0.0, 0.015])
    shifted = reference_of(robot, model, dataclasses.replace(schedule, arms_shift=shift))
    relative = [
        (np.asarray(model.feet(pose)) - np.asarray(model.com(pose))).mean(axis=1)
        for pose in (usual.landing_joint_position, shifted.landing_joint_position)
    ]
    feet = usual.landing_com + relative[0], shifted.landing_com - shift + relative[1]
    np.testing.assert_allclose(*feet, atol=5e-3)
    assert shifted.landing_com[0] == pytest.approx(usual.landing_com[0], abs=1e-9)


@pytest.mark.parametrize("displacement", [*GOALS, (0.0, 1.2, 0.0), (-0.9, 1.0, 0.0)], ids=str)
def test_the_feet_centre_lands_at_the_goal_even_where_legs_do_not_reach_as_far_ahead_as_they_should(
    a_robot, displacement
):
    robot, model = a_robot
    schedule, reference = jump(robot, model, displacement)
    pose = reference.landing_joint_position[None]
    feet = (model.feet_at(pose) - model.coms(pose)[:, None])[0].mean(axis=0)
    radius = np.mean([point.radius for point in robot.contact_points])
    np.testing.assert_allclose(reference.landing_com + feet, schedule.landing_centre + [0.0, 0.0, radius], atol=1e-9)


def test_the_path_at_its_knots_is_what_the_problem_has(a_robot):
    robot, model = a_robot
    _, reference = jump(robot, model, GOALS[1])
    path, q = reference.flight_path, robot.poses["home"]
    for k, expected in enumerate(path.at_knots(q)[1:]):
        _, fraction, *pose = path.parameters(k)
        q = q + fraction * (np.array(pose) - q)
        np.testing.assert_allclose(q, expected, atol=1e-9)


@pytest.fixture(scope="module")
def from_a_trot(robot):
    """Schedule and reference of a take-off on one diagonal pair, then on the other 0.3 m ahead."""
    first, second = pair(robot, "fr", "hl"), pair(robot, "fl", "hr")
    estimate = moving(robot, 0.8, first)
    start = Start.moving(robot, estimate, sequence(robot, estimate.q, (0.12, first, 0.0), (0.14, second, 0.3)))
    settings, model = robot.section("planner", PlannerSettings), base_frame_model(robot)
    schedule = contact_schedule(
        MotionRequest(motion="jump", displacement=np.array([0.7, 0.0, 0.0])),
        load_motion("jump", robot),
        robot,
        settings.dt,
        settings.flight_knots,
        sequence=start.sequence,
    )
    ik = InverseKinematics(robot, model)
    return start, schedule, body_reference(schedule, start, robot, model, ik, settings)


def test_the_body_path_begins_with_the_state_of_the_start(from_a_trot, robot):
    start, _, reference = from_a_trot
    data = robot.model.createData()
    momentum = pin.computeCentroidalMomentum(robot.model, data, start.q, start.v)
    np.testing.assert_allclose(reference.com[0], data.com[0], atol=1e-9)
    np.testing.assert_allclose(reference.com_velocity[0], momentum.linear / robot.mass, atol=1e-12)
    np.testing.assert_allclose(reference.x_0[3:9], [*momentum.linear / robot.mass, *momentum.angular], atol=1e-12)
    np.testing.assert_array_equal(reference.start_joint_velocity, start.v[6:])


def test_the_body_path_is_the_integral_of_its_velocity(from_a_trot):
    _, schedule, reference = from_a_trot
    moved = np.diff(reference.com, axis=0) / schedule.dt
    mean = (reference.com_velocity[1:] + reference.com_velocity[:-1]) / 2
    np.testing.assert_allclose(moved, mean, atol=0.02)


def test_feet_stand_on_their_footholds_while_they_bear_load(from_a_trot):
    _, schedule, reference = from_a_trot
    for ends in (reference.foot_position[:-1], reference.foot_position[1:]):
        np.testing.assert_allclose(ends[schedule.contact], schedule.foothold[schedule.contact], atol=1e-12)


def test_feet_rise_while_they_are_in_the_air_and_sink_to_their_footholds(from_a_trot, robot):
    _, schedule, reference = from_a_trot
    clearance, landing = reference.foot_clearance, np.flatnonzero(~schedule.contact[0])
    lands = int(np.argmax(schedule.contact[:, landing[0]]))
    swing = clearance[: lands + 1, landing[0]]
    np.testing.assert_allclose(swing, swing[::-1])
    assert swing.max() == robot.section("planner", PlannerSettings).swing_clearance
    assert np.all(clearance[:-1][schedule.contact] == 0.0)
