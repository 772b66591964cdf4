"""What the hardware measures in one tick, in SI units and Pinocchio order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """One time-consistent packet of what the hardware measures."""

    time: float  # stamp [s]
    orientation: np.ndarray  # (4,) attitude of the base in W as the IMU reports it, quaternion xyzw
    angular_velocity: np.ndarray  # (3,) of the base, in B [rad/s]
    linear_acceleration: np.ndarray  # (3,) specific force at the base origin, in B [m/s²]
    joint_position: np.ndarray  # (n,) [rad]
    joint_velocity: np.ndarray  # (n,) [rad/s]
    joint_torque: np.ndarray  # (n,) delivered in the last period [N·m]
    sequence: int = 0  # number of the packet; a gap is a lost packet
    localization: np.ndarray | None = None  # (3,) base position in W [m], if something measures it
