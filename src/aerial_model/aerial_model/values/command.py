"""What the joint drives are told in one tick, in SI units and Pinocchio order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
