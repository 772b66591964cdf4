import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerial_model.robot.robot import Robot

LAW = Robot.load("mini_cheetah").actuators
LEG = slice(0, 3)  # ab/adduction, hip, knee
speeds = st.floats(-60.0, 60.0)


def test_no_load_speeds_are_the_published_ones():
    np.testing.assert_allclose(LAW.no_load_speed[LEG], [40.0, 40.0, 25.7], atol=0.05)


def test_full_torque_is_available_up_to_the_published_speeds():
    np.testing.assert_allclose(LAW.corner_speed[LEG], [28.5, 28.5, 18.3], atol=0.05)


def test_the_rotor_reflects_with_the_square_of_the_gear_ratio():
    np.testing.assert_allclose(LAW.armature[LEG], [0.002268, 0.002268, 0.005484], atol=1e-6)


def test_full_torque_just_below_the_corner_and_none_at_the_no_load_speed():
    _, at_corner = LAW.torque_bounds(LAW.corner_speed - 1e-9)
    _, at_no_load = LAW.torque_bounds(LAW.no_load_speed)
    np.testing.assert_allclose(at_corner, LAW.torque_max)
    np.testing.assert_allclose(at_no_load, 0.0, atol=1e-9)


@given(speeds, st.floats(-100.0, 100.0))
def test_what_is_delivered_needs_no_more_than_the_bus_voltage_or_brakes_at_full_torque(speed, torque):
    speed = np.full(12, speed)
    delivered = LAW.available(np.full(12, torque), speed)
    assert np.all(np.abs(delivered) <= LAW.torque_max + 1e-9)
    within = LAW.voltage_ratio(delivered, speed) <= 1 + 1e-9
    braking = (np.sign(delivered) == -np.sign(speed)) & np.isclose(np.abs(delivered), LAW.torque_max)
    assert np.all(within | braking)


@given(speeds)
def test_losses_oppose_the_motion(speed):
    assert np.all(LAW.friction(np.full(12, speed), 0.1) * speed >= 0)


def test_the_two_motor_constants_are_kept_apart():
    torque, speed = np.zeros(12), np.zeros(12)
    torque[0], speed[1] = 18.0, 10.0
    voltage = LAW.voltage(torque, speed)
    assert voltage[0] == pytest.approx(18.0 / 6 / 0.075 * 0.173)
    assert voltage[1] == pytest.approx(10.0 * 6 * 0.10)
