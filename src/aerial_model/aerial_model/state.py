"""What crosses the border between robot and controller in one tick, as pure values in SI units and Pinocchio order."""

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


@dataclass(frozen=True, kw_only=True)
class Command:
    """What the joint drives are told: τ = torque + stiffness (position − q) + damping (velocity − q̇)."""

    torque: np.ndarray  # (n,) feed-forward [N·m]
    position: np.ndarray  # (n,) set-point [rad]
    velocity: np.ndarray  # (n,) set-point [rad/s]
    stiffness: np.ndarray  # (n,) [N·m/rad]
    damping: np.ndarray  # (n,) [N·m·s/rad]
    state_time: float = 0.0  # stamp of the measurement this answers [s]
    state_sequence: int = 0  # its number

    def requested_torque(self, joint_position: np.ndarray, joint_velocity: np.ndarray) -> np.ndarray:
        """Return the torque ``(n,)`` [N·m] asked of the motors at a joint state, before any limit."""
        return (
            self.torque
            + self.stiffness * (self.position - joint_position)
            + self.damping * (self.velocity - joint_velocity)
        )


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Where the robot is believed to be, in W (the ``odom`` frame)."""

    time: float  # [s]
    q: np.ndarray  # (nq,) base position [m], quaternion xyzw, joint positions [rad]
    v: np.ndarray  # (nv,) base twist in B, linear first [m/s, rad/s], joint velocities [rad/s]
    position_variance: float = 0.0  # of the base along any axis of W; 0: not known [m²]
    velocity_variance: float = 0.0  # of the base along any axis of W; 0: not known [m²/s²]
