"""The raw messages of the control loop against rclpy's own serialization."""

import dataclasses

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from aerial_model.robot.robot import Robot
from aerial_model.values.command import Command
from aerial_model.values.measurement import Measurement
from aerial_msgs.msg import JointCommand, RobotState
from aerial_ros.wire import CommandWire, StateWire

TIME = 1_764_130_000.25  # [s], of a robot whose clock is the calendar's
VECTORS = ("angular_velocity", "linear_acceleration")
ROWS = ("joint_position", "joint_velocity", "joint_torque")
SET_POINTS = ("torque", "position", "velocity", "stiffness", "damping")


@pytest.fixture(scope="module", params=["mini_cheetah", "mit_humanoid"])
def robot(request):
    return Robot.load(request.param)


def measurement_of(robot, localization=None):
    random = np.random.default_rng(1)
    return Measurement(
        time=TIME,
        sequence=2**40 + 1,
        orientation=np.array([0.0, 0.6, 0.0, 0.8]),
        localization=localization,
        **{name: random.normal(size=3) for name in VECTORS},
        **{name: random.normal(size=robot.n_joints) for name in ROWS},
    )


def command_of(robot):
    random = np.random.default_rng(2)
    rows = {name: random.normal(size=robot.n_joints) for name in SET_POINTS}
    return Command(state_time=TIME, state_sequence=2**40 + 1, **rows)


def assert_equal(a, b):
    for field in dataclasses.fields(a):
        np.testing.assert_array_equal(getattr(a, field.name), getattr(b, field.name), err_msg=field.name)


@pytest.mark.parametrize("localization", [None, np.array([1.0, -2.0, 3.0])])
def test_a_state_is_what_rclpy_writes_and_reads(robot, localization):
    wire, measurement = StateWire(robot), measurement_of(robot, localization)
    message = deserialize_message(wire.write(measurement), RobotState)
    assert (message.stamp.sec, message.stamp.nanosec) == (1_764_130_000, 250_000_000)
    assert message.sequence == measurement.sequence
    assert message.has_localization == (localization is not None)
    for name in ("orientation", *VECTORS, *ROWS):
        np.testing.assert_array_equal(getattr(message, name), getattr(measurement, name))
    for data in (wire.write(measurement), serialize_message(message)):
        assert_equal(wire.read(data), measurement)


def test_a_command_is_what_rclpy_writes_and_reads(robot):
    wire, command = CommandWire(robot), command_of(robot)
    message = deserialize_message(wire.write(command), JointCommand)
    assert message.stamp == message.state_stamp
    for name in SET_POINTS:
        np.testing.assert_array_equal(getattr(message, name), getattr(command, name))
    for data in (wire.write(command), serialize_message(message)):
        assert_equal(wire.read(data), command)


def test_big_endian_is_read_as_well():
    """By rclpy: as from a robot's computer of another kind."""
    robot = Robot.load("mini_cheetah")
    wire, command = CommandWire(robot), command_of(robot)
    data = wire.write(command)
    words = np.frombuffer(data[4:], "<u4").astype(">u4").reshape(-1)
    swapped = words.copy()
    first = 6  # 32-bit words: two stamps, then numbers of 64 bits and the lengths of sequences
    n = robot.n_joints
    at = first
    swapped[4:6] = words[5], words[4]
    for _ in SET_POINTS:
        at += 2  # the length and what fills up to a multiple of 8
        swapped[at : at + 2 * n] = words[at : at + 2 * n].reshape(n, 2)[:, ::-1].ravel()
        at += 2 * n
    assert_equal(wire.read(b"\x00\x00\x00\x00" + swapped.tobytes()), command)


def test_what_is_read_can_be_computed_with_in_place(robot):
    read = StateWire(robot).read(StateWire(robot).write(measurement_of(robot)))
    for name in ("orientation", *VECTORS, *ROWS):
        assert getattr(read, name).flags.aligned
        assert getattr(read, name).flags.writeable


def test_a_row_of_another_length_is_named():
    robot = Robot.load("mini_cheetah")
    message = JointCommand(**{name: [0.0] * robot.n_joints for name in SET_POINTS})
    message.velocity = [0.0] * 3
    with pytest.raises(ValueError, match="velocity: expected 12 numbers, one a joint, found 3"):
        CommandWire(robot).read(serialize_message(message))
    with pytest.raises(ValueError, match="joint_position: expected 12 numbers, one a joint, found 0"):
        StateWire(robot).read(serialize_message(RobotState()))


def test_rows_of_other_lengths_that_fill_as_many_bytes_are_no_command():
    robot = Robot.load("mini_cheetah")
    message = JointCommand(**{name: [0.0] * robot.n_joints for name in SET_POINTS})
    message.torque, message.position = [0.0] * 11, [0.0] * 13
    with pytest.raises(ValueError, match="torque: expected 12 numbers, one a joint, found 11"):
        CommandWire(robot).read(serialize_message(message))


def test_a_command_that_is_no_number_is_named():
    robot = Robot.load("mini_cheetah")
    command = dataclasses.replace(command_of(robot), damping=np.full(robot.n_joints, np.nan))
    with pytest.raises(ValueError, match="damping: expected finite numbers, found"):
        CommandWire(robot).read(CommandWire(robot).write(command))


def test_bytes_that_hold_no_message_are_said_to_hold_none():
    robot = Robot.load("mini_cheetah")
    data = CommandWire(robot).write(command_of(robot))
    with pytest.raises(ValueError, match="expected a JointCommand, found 100 bytes that hold none"):
        CommandWire(robot).read(data[:100])
