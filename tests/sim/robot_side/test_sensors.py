import dataclasses

import numpy as np
import pytest

from aerial_model.errors import ConfigurationError
from aerial_model.numerics import rotation
from aerial_model.robot.robot import Robot
from aerial_sim.robot_side.sensors import SensorNoise, Sensors

SAMPLES = 4000
LAW = Robot.load("mini_cheetah").actuators
JOINTS = len(LAW.gear_ratio)
LOAD = np.full(JOINTS, 5.0)  # [N·m]
COUNTS = 16384  # 14 bits


@pytest.fixture
def nominal():
    return Sensors(SensorNoise(), LAW, np.random.default_rng(0))


@pytest.fixture
def attitude():
    return rotation.exp(np.array([0.3, -1.0, 2.0]))


def samples(read, truth):
    return np.array([read(truth) for _ in range(SAMPLES)])


def test_attitude_is_off_by_its_bias_in_the_mean_and_by_its_noise_around_it(nominal, attitude):
    readings = samples(nominal.orientation, attitude)
    errors = rotation.log(rotation.multiply(rotation.conjugate(attitude), readings))
    np.testing.assert_allclose(np.abs(errors.mean(axis=0)), np.radians(0.3), atol=2e-4)
    assert np.abs(errors - errors.mean(axis=0)).max() < 0.0032
    np.testing.assert_allclose(errors.std(axis=0), 0.003 / np.sqrt(3), rtol=0.05)


def test_the_gyro_has_uniform_noise_and_no_bias(nominal):
    truth = np.array([1.0, 2.0, 3.0])
    errors = samples(nominal.angular_velocity, truth) - truth
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=3e-4)
    assert np.abs(errors).max() <= 0.005
    np.testing.assert_allclose(errors.std(axis=0), 0.005 / np.sqrt(3), rtol=0.05)


def test_the_accelerometer_has_a_bias_of_full_size_on_every_axis(nominal):
    truth = np.array([0.0, 0.0, 9.81])
    errors = samples(nominal.linear_acceleration, truth) - truth
    np.testing.assert_allclose(np.abs(errors.mean(axis=0)), 0.05, atol=3e-4)
    assert np.abs(errors - errors.mean(axis=0)).max() < 0.0053


def test_encoders_are_off_by_a_constant(nominal):
    truth = np.linspace(-1, 1, JOINTS)
    errors = samples(lambda joints: nominal.joint_position(joints, LOAD), truth) - truth
    np.testing.assert_allclose(np.abs(errors), 0.001, atol=1e-12)
    assert np.all(np.ptp(errors, axis=0) < 1e-12)


def test_joint_rates_have_gaussian_noise(nominal):
    errors = samples(nominal.joint_velocity, np.zeros(JOINTS))
    np.testing.assert_allclose(errors.std(axis=0), 0.05, rtol=0.05)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=0.004)


def test_without_noise_sensors_tell_the_truth(robot, attitude):
    sensors = Sensors(SensorNoise.of(robot, "off"), LAW, np.random.default_rng(0))
    truth = np.array([1.0, 2.0, 3.0])
    joints = np.linspace(-1, 1, JOINTS)
    np.testing.assert_allclose(sensors.orientation(attitude), attitude, atol=1e-15)
    np.testing.assert_array_equal(sensors.angular_velocity(truth), truth)
    np.testing.assert_array_equal(sensors.linear_acceleration(truth), truth)
    np.testing.assert_array_equal(sensors.joint_position(joints, LOAD), joints)
    np.testing.assert_array_equal(sensors.joint_velocity(joints), joints)


def test_bias_signs_differ_from_seed_to_seed(robot):
    noise = SensorNoise()
    draws = {
        tuple(Sensors(noise, LAW, np.random.default_rng(seed)).joint_position(np.zeros(JOINTS), LOAD))
        for seed in range(20)
    }
    assert len(draws) == 20


def exact(**options):
    none = dict.fromkeys((field.name for field in dataclasses.fields(SensorNoise)), 0.0)
    return Sensors(SensorNoise(**(none | options)), LAW, np.random.default_rng(0))


def test_encoders_count_in_steps_of_the_motors_turn():
    truth = np.random.default_rng(1).uniform(-1, 1, (SAMPLES, JOINTS))
    sensors = exact(encoder_counts=COUNTS)
    readings = np.array([sensors.joint_position(joints, LOAD) for joints in truth])
    step = 2 * np.pi / (COUNTS * LAW.gear_ratio)
    np.testing.assert_allclose(readings / step, np.round(readings / step), atol=1e-6)
    np.testing.assert_allclose((readings - truth).std(axis=0), step / np.sqrt(12), rtol=0.05)


def test_gears_play_with_the_sign_of_the_motors_torque():
    sensors, joints = exact(gear_backlash=0.005), np.linspace(-1, 1, JOINTS)
    for torque, play in (
        (LOAD, 0.0025),
        (0.1 * LAW.dry_friction, 0.0025),
        (-LOAD, -0.0025),
        (np.zeros(JOINTS), -0.0025),
    ):
        np.testing.assert_allclose(sensors.joint_position(joints, torque) - joints, play, atol=1e-15)


def test_localization_comes_at_its_own_rate_with_its_own_noise():
    sensors, truth = exact(localization_rate=60.0, localization_noise=0.01), np.array([1.0, 2.0, 3.0])
    reports = [sensors.localization(0.002 * k, truth) for k in range(50_000)]
    errors = np.array([report for report in reports if report is not None]) - truth
    assert len(errors) == pytest.approx(0.002 * 50_000 * 60, abs=1)
    np.testing.assert_allclose(errors.std(axis=0), 0.01, rtol=0.05)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=5e-4)


def test_nominal_noise_has_neither_steps_nor_play_nor_localization(nominal):
    assert (SensorNoise().encoder_counts, SensorNoise().gear_backlash, SensorNoise().localization_rate) == (0, 0, 0)
    assert nominal.localization(0.0, np.zeros(3)) is None


def test_a_robot_may_bring_its_own_noise(robot):
    noise = SensorNoise.of(robot.with_section("sensors", gyro_noise=0.5), "nominal")
    assert noise.gyro_noise == 0.5
    assert noise.encoder_bias == SensorNoise().encoder_bias


@pytest.mark.parametrize("change", [{"gyro_noise": -1.0}, {"gyro_nois": 1.0}])
def test_a_senseless_noise_is_refused(robot, change):
    with pytest.raises(ConfigurationError, match="gyro_nois"):
        SensorNoise.of(robot.with_section("sensors", **change), "nominal")
