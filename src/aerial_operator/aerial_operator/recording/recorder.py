"""A recording of a run: messages kept as they came, written as an MCAP bag that common ROS tools read.

While a control loop runs beside it, a recorder only keeps bytes (some 6 µs a message); it decodes and writes later.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rosbags.rosbag2 import StoragePlugin, Writer

from aerial_msgs.msg import (
    ControllerStatus,
    GroundTruth,
    JointCommand,
    MotionPlan,
    MotionResult,
    MotionSelection,
    RobotState,
)

TOPICS = {
    "state": RobotState,
    "joint_command": JointCommand,
    "controller_status": ControllerStatus,
    "ground_truth": GroundTruth,
    "odometry": Odometry,
    "motion_selection": MotionSelection,
    "motion_plan": MotionPlan,
    "motion_result": MotionResult,
}
_BEST_EFFORT = ("state", "joint_command")  # as they are sent in real time
_DEPTH = 1000  # messages that may wait while another callback runs
_BAG_VERSION = 9
_SEPARATOR = "=" * 80


class Recorder:
    """Keeps every message of some topics from its construction on.

    Args:
        node: that subscribes.
        topics: name → type.
    """

    def __init__(self, node: Node, topics: Mapping[str, type] = TOPICS) -> None:
        self._types = dict(topics)
        self._names = {topic: node.resolve_topic_name(topic) for topic in topics}
        self._kept: dict[str, list[tuple[int, bytes]]] = {topic: [] for topic in topics}  # arrival [ns], serialized
        for topic, kind in topics.items():
            reliability = ReliabilityPolicy.BEST_EFFORT if topic in _BEST_EFFORT else ReliabilityPolicy.RELIABLE
            profile = QoSProfile(depth=_DEPTH, reliability=reliability)
            node.create_subscription(kind, topic, _keeper(self._kept[topic]), profile, raw=True)

    def messages(self, topic: str) -> Iterator[Any]:
        """Yield the messages of a topic in the order they came."""
        for _, data in self._kept[topic]:
            yield deserialize_message(data, self._types[topic])

    def arrivals(self, topic: str) -> list[float]:
        """Return when the messages of a topic came, wall time [s]."""
        return [arrival * 1e-9 for arrival, _ in self._kept[topic]]

    def write(self, folder: Path) -> None:
        """Write everything kept as a bag: an MCAP file and its metadata in ``folder``, replacing what is there."""
        shutil.rmtree(folder, ignore_errors=True)
        with Writer(folder, version=_BAG_VERSION, storage_plugin=StoragePlugin.MCAP) as bag:
            connections = {}
            for topic, kind in self._types.items():
                name = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
                text, digest = definition(name)
                connections[topic] = bag.add_connection(self._names[topic], name, msgdef=text, rihs01=digest)
            everything = [
                (arrival, topic, data) for topic, messages in self._kept.items() for arrival, data in messages
            ]
            for arrival, topic, data in sorted(everything, key=lambda entry: entry[0]):
                bag.write(connections[topic], arrival, data)


def definition(name: str) -> tuple[str, str]:
    """Return text and hash of a message's definition as installed, the text followed by those of the types it uses.

    Args:
        name: such as ``nav_msgs/msg/Odometry``.
    """
    description = json.loads(_installed(name, "json"))
    used = [entry["type_name"] for entry in description["type_description_msg"]["referenced_type_descriptions"]]
    texts = [_installed(name, "msg")]
    texts += [f"{_SEPARATOR}\nMSG: {other.replace('/msg/', '/')}\n{_installed(other, 'msg')}" for other in used]
    digest = next(entry["hash_string"] for entry in description["type_hashes"] if entry["type_name"] == name)
    return "\n".join(texts), digest


def _installed(name: str, suffix: str) -> str:
    package, kind, message = name.split("/")
    return Path(get_package_share_directory(package), kind, f"{message}.{suffix}").read_text(encoding="utf-8")


def _keeper(kept: list[tuple[int, bytes]]) -> Any:
    def keep(data: bytes) -> None:
        kept.append((time.time_ns(), data))

    return keep
