"""Messages that only the controller sends: its status and its estimate."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from geometry_msgs.msg import Point, Quaternion, Vector3
from nav_msgs.msg import Odometry

from aerial_model.robot.robot import BASE_ANGULAR, BASE_LINEAR, BASE_ORIENTATION, BASE_POSITION
from aerial_model.values.estimate import Estimate
from aerial_msgs.msg import ControllerStatus as ControllerStatusMessage
from aerial_ros.messages import to_stamp
from aerial_wbic.controller import ControllerStatus

ODOMETRY_FRAME = "odom"
BASE_FRAME = "base_link"
WINDOW_TICKS = 1000  # that a status looks back on: 2 s
_ERRORS = ("com_error", "com_velocity_error", "orientation_error", "angular_momentum_error")
_COUNTERS = ("ticks", "saturated_ticks", "fallback_ticks")


@dataclass
class Pace:
    """How the node kept up."""

    missed_ticks: int = 0  # states that never got their command in time, since activation
    # State received to command published, of the last ticks [s]: enough of them for a 99th percentile.
    tick_times: deque[float] = field(default_factory=lambda: deque(maxlen=WINDOW_TICKS))

    def percentiles(self, *shares: float) -> list[float]:
        """Return the tick times [s] that shares [%] of the last ticks did not exceed; 0 when there were none."""
        if not self.tick_times:
            return [0.0] * len(shares)
        return [float(value) for value in np.percentile(self.tick_times, shares)]


def status_to_message(status: ControllerStatus, pace: Pace, time: float, robot: str) -> ControllerStatusMessage:
    """Return the message that carries a status as of ``time`` [s]."""
    p50, p99, greatest = pace.percentiles(50, 99, 100)
    return ControllerStatusMessage(
        stamp=to_stamp(time),
        robot=robot,
        phase=int(status.phase),
        request_id=status.request_id,
        time_in_plan=float(status.time_in_plan),
        missed_ticks=int(pace.missed_ticks),
        tick_time_p50=p50,
        tick_time_p99=p99,
        tick_time_max=greatest,
        **{name: np.array(getattr(status, name), dtype=np.float64) for name in _ERRORS},
        **{name: int(getattr(status, name)) for name in _COUNTERS},
    )


def odometry_to_message(estimate: Estimate) -> Odometry:
    """Return the message that carries an estimate, frames as REP 105; its covariances are not filled in."""
    odometry = Odometry(child_frame_id=BASE_FRAME)
    odometry.header.stamp = to_stamp(estimate.time)
    odometry.header.frame_id = ODOMETRY_FRAME
    x, y, z = estimate.q[BASE_POSITION].tolist()
    odometry.pose.pose.position = Point(x=x, y=y, z=z)
    x, y, z, w = estimate.q[BASE_ORIENTATION].tolist()
    odometry.pose.pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
    x, y, z = estimate.v[BASE_LINEAR].tolist()
    odometry.twist.twist.linear = Vector3(x=x, y=y, z=z)
    x, y, z = estimate.v[BASE_ANGULAR].tolist()
    odometry.twist.twist.angular = Vector3(x=x, y=y, z=z)
    return odometry
