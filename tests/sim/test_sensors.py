import numpy as np
import pytest

from aerial_model import rotation
from aerial_model.errors import ConfigurationError
from aerial_sim.sensors import SensorNoise, Sensors

SAMPLES = 4000
JOINTS = 12


@pytest.fixture
def nominal():
    return Sensors(SensorNoise(), JOINTS, np.random.default_rng(0))


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
    errors = samples(nominal.joint_position, truth) - truth
    np.testing.assert_allclose(np.abs(errors), 0.001, atol=1e-12)
    assert np.all(np.ptp(errors, axis=0) < 1e-12)


def test_joint_rates_have_gaussian_noise(nominal):
    errors = samples(nominal.joint_velocity, np.zeros(JOINTS))
    np.testing.assert_allclose(errors.std(axis=0), 0.05, rtol=0.05)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=0.004)


def test_without_noise_sensors_tell_the_truth(robot, attitude):
    sensors = Sensors(SensorNoise.of(robot, "off"), JOINTS, np.random.default_rng(0))
    truth = np.array([1.0, 2.0, 3.0])
    joints = np.linspace(-1, 1, JOINTS)
    np.testing.assert_allclose(sensors.orientation(attitude), attitude, atol=1e-15)
    np.testing.assert_array_equal(sensors.angular_velocity(truth), truth)
    np.testing.assert_array_equal(sensors.linear_acceleration(truth), truth)
    np.testing.assert_array_equal(sensors.joint_position(joints), joints)
    np.testing.assert_array_equal(sensors.joint_velocity(joints), joints)


def test_bias_signs_differ_from_seed_to_seed(robot):
    noise = SensorNoise()
    draws = {
        tuple(Sensors(noise, JOINTS, np.random.default_rng(seed)).joint_position(np.zeros(JOINTS)))
        for seed in range(20)
    }
    assert len(draws) == 20


def test_a_robot_may_bring_its_own_noise(robot):
    noise = SensorNoise.of(robot.with_section("sensors", gyro_noise=0.5), "nominal")
    assert noise.gyro_noise == 0.5
    assert noise.encoder_bias == SensorNoise().encoder_bias


@pytest.mark.parametrize("change", [{"gyro_noise": -1.0}, {"gyro_nois": 1.0}])
def test_a_senseless_noise_is_refused(robot, change):
    with pytest.raises(ConfigurationError, match="gyro_nois"):
        SensorNoise.of(robot.with_section("sensors", **change), "nominal")
