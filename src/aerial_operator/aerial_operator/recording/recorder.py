"""Records running nodes.

While a control loop runs beside it, a recorder only keeps bytes (some 6 µs a message); decoding and writing come later.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from aerial_operator.recording.recording import TOPICS, Recording

_BEST_EFFORT = ("state", "joint_command")  # as they are sent in real time
_DEPTH = 1000  # messages that may wait while another callback runs


class Recorder(Recording):
    """A recording that grows: every message of some topics from its construction on.

    Args:
        node: that subscribes.
        topics: name → type.
    """

    def __init__(self, node: Node, topics: Mapping[str, type] = TOPICS) -> None:
        super().__init__({topic: node.resolve_topic_name(topic) for topic in topics}, topics)
        for topic, kind in topics.items():
            reliability = ReliabilityPolicy.BEST_EFFORT if topic in _BEST_EFFORT else ReliabilityPolicy.RELIABLE
            profile = QoSProfile(depth=_DEPTH, reliability=reliability)
            node.create_subscription(kind, topic, self._keeper(topic), profile, raw=True)

    def _keeper(self, topic: str) -> Callable[[bytes], None]:
        def keep(data: bytes) -> None:
            self.keep(topic, time.time_ns(), data)

        return keep
