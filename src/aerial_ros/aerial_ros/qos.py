"""Quality of service of every topic, in one place, since both ends must agree."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

# All but the control loop's are reliable: any subscriber may connect, one that asks for less included.
EVENT = QoSProfile(depth=10)  # selections, plans
# A plan may begin before its node knows that the one who asked listens: late joiners get the last answers, too.
ANSWER = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # late joiners get the last one
TELEMETRY = QoSProfile(depth=5)  # at 100 Hz and less
RECORD = QoSProfile(depth=100)  # at the control rate: what evaluation wants complete


def control(real_time: bool) -> QoSProfile:
    """Return that of ``state`` and ``joint_command``: the newest or nothing in real time, reliable in lock-step."""
    policy = ReliabilityPolicy.BEST_EFFORT if real_time else ReliabilityPolicy.RELIABLE
    return QoSProfile(depth=1, reliability=policy)
