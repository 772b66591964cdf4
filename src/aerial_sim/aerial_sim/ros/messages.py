"""Messages that only the simulator sends: ground truth, and measurements in the form common tools read."""

from __future__ import annotations

from array import array

import numpy as np
from geometry_msgs.msg import Point, Quaternion, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState

from aerial_model.robot.robot import (
    BASE_ANGULAR,
    BASE_LINEAR,
    BASE_ORIENTATION,
    BASE_POSITION,
    JOINT_POSITION,
    JOINT_VELOCITY,
    Robot,
)
from aerial_model.values.measurement import Measurement
from aerial_msgs.msg import GroundTruth as GroundTruthMessage
from aerial_ros.messages import doubles, from_stamp, to_stamp
from aerial_sim.ground_truth import GroundTruth

WORLD_FRAME = "world"
BASE_FRAME = "base_link"
_ROWS = ("requested_torque", "delivered_torque")
_RATIOS = ("peak_torque_ratio", "peak_voltage_ratio")


def ground_truth_to_message(truth: GroundTruth, robot: Robot) -> GroundTruthMessage:
    """Return the message that carries a ground truth."""
    odometry = Odometry(child_frame_id=BASE_FRAME)
    odometry.header.stamp = to_stamp(truth.time)
    odometry.header.frame_id = WORLD_FRAME
    odometry.pose.pose.position = _named(Point, truth.q[BASE_POSITION])
    odometry.pose.pose.orientation = _named(Quaternion, truth.q[BASE_ORIENTATION])
    odometry.twist.twist.linear = _named(Vector3, truth.v[BASE_LINEAR])
    odometry.twist.twist.angular = _named(Vector3, truth.v[BASE_ANGULAR])
    return GroundTruthMessage(
        odometry=odometry,
        joint_position=doubles(truth.q[JOINT_POSITION]),
        joint_velocity=doubles(truth.v[JOINT_VELOCITY]),
        contact_names=[point.name for point in robot.contact_points],
        contact=truth.contact.tolist(),
        force=doubles(truth.force),
        trunk_contact=truth.trunk_contact,
        other_contacts=list(truth.other_contacts),
        **{name: doubles(getattr(truth, name)) for name in _ROWS},
        **{name: float(getattr(truth, name)) for name in _RATIOS},
    )


def ground_truth_from_message(message: GroundTruthMessage) -> GroundTruth:
    """Return the ground truth a message carries."""
    pose, twist = message.odometry.pose.pose, message.odometry.twist.twist
    position, orientation = pose.position, pose.orientation
    base = [position.x, position.y, position.z, orientation.x, orientation.y, orientation.z, orientation.w]
    velocity = [twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y, twist.angular.z]
    return GroundTruth(
        time=from_stamp(message.odometry.header.stamp),
        q=np.concatenate([base, message.joint_position]),
        v=np.concatenate([velocity, message.joint_velocity]),
        contact=np.array(message.contact, dtype=bool),
        force=np.array(message.force).reshape(-1, 3),
        trunk_contact=message.trunk_contact,
        other_contacts=tuple(message.other_contacts),
        **{name: np.array(getattr(message, name)) for name in _ROWS},
        **{name: getattr(message, name) for name in _RATIOS},
    )


def joint_state_to_message(measurement: Measurement, robot: Robot) -> JointState:
    """Return the measured joint states."""
    message = JointState(
        name=list(robot.joint_names),
        position=doubles(measurement.joint_position),
        velocity=doubles(measurement.joint_velocity),
        effort=doubles(measurement.joint_torque),
    )
    message.header.stamp = to_stamp(measurement.time)
    return message


def imu_to_message(measurement: Measurement) -> Imu:
    """Return what the inertial unit measures."""
    message = Imu(
        orientation=_named(Quaternion, measurement.orientation),
        angular_velocity=_named(Vector3, measurement.angular_velocity),
        linear_acceleration=_named(Vector3, measurement.linear_acceleration),
    )
    message.header.stamp = to_stamp(measurement.time)
    message.header.frame_id = BASE_FRAME
    return message


def _named(kind: type, values: np.ndarray) -> Point | Quaternion | Vector3:
    """Return a message whose fields x, y, z (, w) hold ``values``."""
    return kind(**dict(zip("xyzw", array("d", values.tolist()), strict=False)))
