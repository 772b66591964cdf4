"""The finely integrated flight against MuJoCo-free truths: momentum, a known spin, and its own convergence."""

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.numerics import rotation
from aerial_model.robot.robot import Robot
from aerial_planner.assembly.flight import ArmCourse, LiftOff, integrate_flight
from aerial_planner.kinematics.base_frame import base_frame_model
from aerial_planner.reference.flight_path import FlightPath

T = 0.4  # [s]


@pytest.fixture(scope="module")
def model(robot):
    return base_frame_model(robot)


def path(robot, tuck="tuck"):
    return FlightPath(
        turning=5,
        ready=14,
        tuck=robot.poses[tuck],
        reach=robot.poses["landing"] + (0.0 if tuck == "home" else 0.1),
        landing=robot.poses["landing"],
        fraction=np.zeros(16),
        settling_time=0.08,
    )


def fly(robot, model, alpha, *, tuck="tuck", step=0.005, rate=0.0):
    return integrate_flight(
        model,
        path(robot, tuck),
        LiftOff(
            orientation=rotation.exp(np.array([0.1, -0.2, 0.3])),
            angular_momentum=np.array(alpha),
            joint_position=robot.poses["home"],
            joint_velocity=np.full(12, rate),
        ),
        ArmCourse(joints=robot.arms, position=np.zeros((17, 0))),
        duration=T,
        step=step,
    )


def test_angular_momentum_is_conserved_while_the_legs_move(robot, model):
    alpha = np.array([0.3, 1.0, -0.5])
    flight = fly(robot, model, alpha, rate=2.0)
    data = robot.model.createData()
    for k in range(len(flight.time)):
        q = np.concatenate([np.zeros(3), flight.orientation[k], flight.joint_position[k]])
        v = np.concatenate([np.zeros(3), flight.angular_velocity[k], flight.joint_velocity[k]])
        h = pin.computeCentroidalMomentum(robot.model, data, q, v)
        np.testing.assert_allclose(h.angular, alpha, atol=1e-9)


def test_halving_the_step_changes_the_landing_attitude_by_nothing_that_matters(robot, model):
    coarse, fine = (fly(robot, model, [0.5, 2.5, 0.3], step=step) for step in (0.01, 0.0025))
    miss = rotation.log(rotation.multiply(rotation.conjugate(fine.orientation[-1]), coarse.orientation[-1]))
    assert np.rad2deg(np.linalg.norm(miss)) < 0.03


def test_still_legs_and_no_momentum_leave_the_attitude_alone(robot, model):
    flight = fly(robot, model, [0.0, 0.0, 0.0], tuck="home")
    np.testing.assert_allclose(flight.orientation, np.tile(flight.orientation[0], (len(flight.time), 1)), atol=1e-12)


def test_joint_rates_are_the_derivative_of_the_path(robot, model):
    flight = fly(robot, model, [0.0, 0.0, 0.0], rate=3.0, step=1e-4)
    numeric = np.gradient(flight.joint_position, flight.time, axis=0)
    np.testing.assert_allclose(flight.joint_velocity[2:-2], numeric[2:-2], atol=0.05)


def test_the_flight_ends_in_the_landing_pose(robot, model):
    np.testing.assert_allclose(
        fly(robot, model, [0, 0, 0], rate=3.0).joint_position[-1], robot.poses["landing"], atol=1e-9
    )


def test_arms_go_through_their_knots_from_the_rates_they_leave_the_ground_with():
    robot = Robot.load("mit_humanoid")
    arms, rates = robot.arms, np.zeros(robot.n_joints)
    rates[arms] = 2.0
    knots = robot.poses["home"][arms] + 0.5 * np.linspace(0.0, 1.0, 17)[:, None] ** 2
    flight = integrate_flight(
        base_frame_model(robot),
        path(robot),
        LiftOff(
            orientation=rotation.IDENTITY,
            angular_momentum=np.zeros(3),
            joint_position=robot.poses["home"],
            joint_velocity=rates,
        ),
        ArmCourse(joints=arms, position=knots),
        duration=T,
    )
    np.testing.assert_allclose(flight.joint_velocity[0, arms], 2.0)
    np.testing.assert_allclose(flight.joint_position[0, arms], knots[0])
    np.testing.assert_allclose(flight.joint_position[-1, arms], knots[-1], atol=0.05)
    change = np.diff(flight.joint_position[:, arms], axis=0) / np.diff(flight.time)[:, None]
    mean = (flight.joint_velocity[1:, arms] + flight.joint_velocity[:-1, arms]) / 2
    np.testing.assert_allclose(change, mean, atol=0.2)
