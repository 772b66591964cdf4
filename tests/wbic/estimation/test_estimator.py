"""The estimator against truths made here: standing, falling, touching down anywhere, slipping."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.kinematics import Kinematics
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ANGULAR, BASE_LINEAR, BASE_ORIENTATION, BASE_POSITION
from aerial_model.values.measurement import Measurement
from aerial_wbic.estimation.estimator import Estimator

DT = 0.002  # [s]
GRAVITY = np.array([0.0, 0.0, -9.81])  # [m/s²]
STEADY = np.zeros(3)  # [m/s²]
ALL = np.ones(4, dtype=bool)
NONE = np.zeros(4, dtype=bool)

STANDING_TOLERANCE = 0.01  # of the velocity [m/s]
FLIGHT_TOLERANCE = 3e-3  # after half a second without noise; the spin begins at once [m], [m/s]
SETTLED_TOLERANCE = 0.02  # of the velocity, 0.1 s after touchdown [m/s]


@pytest.fixture
def estimator(robot, gains):
    return Estimator(robot, gains.estimator)


def measured(q, v, time, acceleration=STEADY, random=None):
    """What noisy sensors (with ``random``) or perfect ones say at q, v; ``acceleration`` of the base in W."""

    def noise(size, spread):
        return np.zeros(size) if random is None else random.uniform(-spread, spread, size)

    orientation = q[BASE_ORIENTATION]
    return Measurement(
        time=time,
        orientation=rotation.multiply(orientation, rotation.exp(noise(3, 0.003))),
        angular_velocity=v[BASE_ANGULAR] + noise(3, 0.005),
        linear_acceleration=rotation.matrix(orientation).T @ (acceleration - GRAVITY) + noise(3, 0.005),
        joint_position=q[7:] + noise(len(q) - 7, 0.001),
        joint_velocity=v[6:] + noise(len(v) - 6, 0.085),
        joint_torque=np.zeros(len(v) - 6),
    )


def stand(estimator, robot, ticks=300, random=None):
    q, v = robot.standing_configuration(), np.zeros(robot.model.nv)
    for k in range(ticks):
        estimate = estimator.update(measured(q, v, k * DT, random=random), ALL)
    return q, estimate


def test_the_first_measurement_puts_the_support_at_the_origin(estimator, robot):
    q = robot.standing_configuration()
    estimate = estimator.update(measured(q, np.zeros(robot.model.nv), 0.0), ALL)
    np.testing.assert_allclose(estimate.q, q, atol=1e-9)
    np.testing.assert_allclose(estimate.v, 0.0, atol=1e-9)


def test_a_localized_robot_begins_where_it_is_said_to_be(estimator, robot):
    reading = measured(robot.standing_configuration(), np.zeros(robot.model.nv), 0.0)
    place = np.array([3.0, -1.0, 0.5])
    estimate = estimator.update(dataclasses.replace(reading, localization=place), ALL)
    np.testing.assert_allclose(estimate.q[BASE_POSITION], place, atol=1e-9)


def test_in_motion_a_wrong_attitude_is_counted_on(robot, gains):
    """Legs that report a speed report it in the wrong direction, all alike: no mean over feet or time helps."""
    variances = []
    for speed in (0.0, 2.0):
        estimator = Estimator(robot, gains.estimator)
        q, _ = stand(estimator, robot)
        v = np.zeros(robot.model.nv)
        v[BASE_LINEAR] = [0.0, 0.0, speed]
        v[6:] = np.tile(np.linalg.lstsq(leg_jacobian(robot, q), [0.0, 0.0, -speed], rcond=None)[0], 4)
        estimator.update(measured(q, v, 0.6, acceleration=np.array([0.0, 0.0, speed / DT])), ALL)
        for k in range(1, 50):
            estimate = estimator.update(measured(q, v, 0.6 + k * DT), ALL)
        variances.append(estimate.velocity_variance)
    assert np.sqrt(variances[1]) > np.radians(0.3) * 2.0 > np.sqrt(variances[0])


@pytest.mark.parametrize("seed", range(5))
def test_standing_with_noise_it_knows_that_it_stands(estimator, robot, seed):
    q, estimate = stand(estimator, robot, random=np.random.default_rng(seed))
    assert np.abs(estimate.v[BASE_LINEAR]).max() < STANDING_TOLERANCE
    np.testing.assert_allclose(estimate.q[BASE_POSITION], q[BASE_POSITION], atol=2e-3)


def test_standing_errors_are_no_larger_than_it_claims(robot, gains):
    """The velocity's normalized squared error over seeds; in motion, where models err too, see the scenarios."""
    squares = []
    for seed in range(40):
        estimator = Estimator(robot, gains.estimator)
        _, estimate = stand(estimator, robot, ticks=100, random=np.random.default_rng(seed))
        squares.append(estimate.v[BASE_LINEAR] ** 2 / estimate.velocity_variance)
    assert np.mean(squares) < 1.0


@pytest.mark.parametrize("spin", [np.zeros(3), np.array([0.0, 12.0, 0.0]), np.array([3.0, -2.0, 10.0])])
def test_it_follows_a_ballistic_flight_however_it_turns(estimator, robot, spin):
    q, _ = stand(estimator, robot)
    start, throw, time_0 = q[BASE_POSITION].copy(), np.array([1.0, 0.5, 2.0]), 300 * DT
    v = np.concatenate([throw, np.zeros(3), np.zeros(robot.n_joints)])
    estimator.update(measured(q, v, time_0, acceleration=throw / DT), NONE)
    v[BASE_ANGULAR] = spin
    for k in range(1, 250):
        t = k * DT
        q[BASE_ORIENTATION] = rotation.exp(spin * t)
        v[BASE_LINEAR] = rotation.matrix(q[BASE_ORIENTATION]).T @ (throw + GRAVITY * t)
        middle = q.copy()
        middle[BASE_ORIENTATION] = rotation.exp(spin * (t - DT / 2))
        reading = measured(middle, v, time_0 + t, acceleration=GRAVITY)
        reading = dataclasses.replace(reading, orientation=q[BASE_ORIENTATION])
        estimate = estimator.update(reading, NONE)
    expected = start + throw * DT / 2 + throw * t + GRAVITY * t**2 / 2
    np.testing.assert_allclose(estimate.q[BASE_POSITION], expected, atol=FLIGHT_TOLERANCE)
    np.testing.assert_allclose(estimate.v[BASE_LINEAR], v[BASE_LINEAR], atol=FLIGHT_TOLERANCE)


@pytest.mark.parametrize("height", [-0.2, 0.0, 0.3])
def test_it_lands_at_any_height(estimator, robot, height):
    """Nothing is assumed about the ground: after a landing at ``height`` the base is that much higher."""
    q, _ = stand(estimator, robot)
    v = np.zeros(robot.model.nv)
    velocity = np.array([0.0, 0.0, height / 0.2])
    estimator.update(measured(q, _with(v, velocity), 0.6, acceleration=velocity / DT), NONE)
    for k in range(1, 100):
        estimate = estimator.update(measured(q, _with(v, velocity), 0.6 + k * DT), NONE)
    estimator.update(measured(q, v, 0.8, acceleration=-velocity / DT), ALL)
    for k in range(1, 50):
        estimate = estimator.update(measured(q, v, 0.8 + k * DT), ALL)
    assert estimate.q[2] == pytest.approx(q[2] + height, abs=5e-3)
    np.testing.assert_allclose(estimate.v[BASE_LINEAR], 0.0, atol=1e-3)


@pytest.mark.parametrize("late", [0.0, 0.02])
def test_a_late_touchdown_does_not_fool_it(estimator, robot, late):
    """The schedule says ground while the robot still falls at 1.5 m/s: the feet are not believed."""
    q, _ = stand(estimator, robot)
    v, fall = np.zeros(robot.model.nv), np.array([0.5, 0.0, -1.5])
    estimator.update(measured(q, _with(v, fall), 0.6, acceleration=fall / DT), NONE)
    ticks = round(late / DT)
    for k in range(1, ticks + 1):
        fall = fall + GRAVITY * DT
        estimate = estimator.update(measured(q, _with(v, fall), 0.6 + k * DT, acceleration=GRAVITY), ALL)
    if ticks:
        np.testing.assert_allclose(estimate.v[BASE_LINEAR], fall, atol=0.35)
    estimator.update(measured(q, v, 0.6 + (ticks + 1) * DT, acceleration=-fall / DT), ALL)
    for k in range(2, 51):
        estimate = estimator.update(measured(q, v, 0.6 + (ticks + k) * DT), ALL)
    np.testing.assert_allclose(estimate.v[BASE_LINEAR], 0.0, atol=SETTLED_TOLERANCE)


def test_one_slipping_foot_is_outvoted(estimator, robot):
    q, _ = stand(estimator, robot)
    v = np.zeros(robot.model.nv)
    v[6:9] = [0.0, 2.0, -1.0]  # the front left leg swings
    for k in range(50):
        q = pin.integrate(robot.model, q, v * DT)
        estimate = estimator.update(measured(q, v, 0.6 + k * DT), ALL)
    assert np.abs(estimate.v[BASE_LINEAR]).max() < STANDING_TOLERANCE


def test_contact_spheres_roll(estimator, robot):
    """The robot sways over feet that roll: the centres move, and the base by what they do not."""
    kinematics = Kinematics(robot)
    q, _ = stand(estimator, robot)
    v = np.zeros(robot.model.nv)
    v[6:] = np.tile([0.0, 1.0, -0.3], 4)
    for k in range(50):
        state = kinematics.at(q, v)
        spin = state.J_contacts[0][:, 6:]  # only to have the leg's motion; the link turns by hip plus knee about -y
        rate = -(v[7] + v[8])
        rolling = np.array([rate * robot.contact_points[0].radius, 0.0, 0.0])
        v[BASE_LINEAR] = rolling - spin @ v[6:]
        v[2] = -(spin @ v[6:])[2]
        q = pin.integrate(robot.model, q, v * DT)
        estimate = estimator.update(measured(q, v, 0.6 + k * DT), ALL)
    np.testing.assert_allclose(estimate.v[BASE_LINEAR], v[BASE_LINEAR], atol=4e-3)


def test_localization_is_believed(estimator, robot):
    q, _ = stand(estimator, robot)
    elsewhere = q[BASE_POSITION] + [0.5, -0.3, 0.1]
    for k in range(2000):
        reading = measured(q, np.zeros(robot.model.nv), 0.6 + k * DT)
        estimate = estimator.update(dataclasses.replace(reading, localization=elsewhere), NONE)
    np.testing.assert_allclose(estimate.q[BASE_POSITION], elsewhere, atol=0.02)


def test_attitude_follows_the_gyro_at_once_and_the_unit_in_time(estimator, robot, gains):
    q, _ = stand(estimator, robot)
    v = np.zeros(robot.model.nv)
    turned = q.copy()
    turned[BASE_ORIENTATION] = rotation.exp(np.array([0.0, 0.0, 0.1]))
    first = estimator.update(measured(turned, v, 0.6), ALL)
    for k in range(1, 100):
        last = estimator.update(measured(turned, v, 0.6 + k * DT), ALL)
    assert rotation.heading(first.q[BASE_ORIENTATION]) == pytest.approx(
        0.1 * DT / gains.estimator.attitude_time, rel=0.01
    )
    assert rotation.heading(last.q[BASE_ORIENTATION]) == pytest.approx(0.1, abs=1e-4)


def test_reset_forgets(estimator, robot):
    q, _ = stand(estimator, robot)
    estimator.update(measured(q, np.zeros(robot.model.nv), 0.6, acceleration=np.ones(3) * 50), NONE)
    estimator.reset()
    estimate = estimator.update(measured(q, np.zeros(robot.model.nv), 5.0), ALL)
    np.testing.assert_allclose(estimate.q, q, atol=1e-9)
    assert not estimate.v.any()


def leg_jacobian(robot, q):
    """Return the velocity of the first foot per rate of its leg's joints ``(3, 3)``, in B."""
    return Kinematics(robot).at(q, np.zeros(robot.model.nv)).J_contacts[0][:, 6:9]


def _with(v, velocity):
    """Return v with the base moving at ``velocity``, level."""
    v = v.copy()
    v[BASE_LINEAR] = velocity
    return v
