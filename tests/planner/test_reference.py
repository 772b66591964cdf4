"""How the legs are to meet the ground, of robots whose legs and rotors weigh little and of one whose do not."""

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.request import MotionRequest
from aerial_model.robot import Robot
from aerial_planner.inverse_kinematics import InverseKinematics
from aerial_planner.reference import body_reference
from aerial_planner.schedule import contact_schedule, load_motion
from aerial_planner.settings import PlannerSettings
from aerial_planner.symbolic import base_frame_model

GOALS = [(0.0, 0.0, 0.0), (0.52, 0.0, 0.0), (0.0, 0.3, 0.0), (-0.2, 0.0, 0.0)]


@pytest.fixture(scope="module", params=["mini_cheetah", "mit_humanoid"])
def a_robot(request):
    robot = Robot.load(request.param)
    return robot, base_frame_model(robot)


def jump(robot, model, displacement):
    settings = robot.section("planner", PlannerSettings)
    request = MotionRequest(motion="jump", displacement=np.array(displacement))
    schedule = contact_schedule(request, load_motion("jump", robot), robot, settings.dt, settings.flight_knots)
    start = robot.standing_configuration("home")
    ik = InverseKinematics(robot, model)
    return schedule, body_reference(schedule, start, robot, model, ik, settings)


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


def test_the_path_at_its_knots_is_what_the_problem_has(a_robot):
    robot, model = a_robot
    _, reference = jump(robot, model, GOALS[1])
    path, q = reference.flight_path, robot.poses["home"]
    for k, expected in enumerate(path.at_knots(q)[1:]):
        _, fraction, *pose = path.parameters(k)
        q = q + fraction * (np.array(pose) - q)
        np.testing.assert_allclose(q, expected, atol=1e-9)
