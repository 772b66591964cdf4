"""Where the robot is believed to be, in SI units and Pinocchio order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Where the robot is believed to be, in W (the ``odom`` frame)."""

    time: float  # [s]
    q: np.ndarray  # (nq,) base position [m], quaternion xyzw, joint positions [rad]
    v: np.ndarray  # (nv,) base twist in B, linear first [m/s, rad/s], joint velocities [rad/s]
    position_variance: float = 0.0  # of the base along any axis of W; 0: not known [m²]
    velocity_variance: float = 0.0  # of the base along any axis of W; 0: not known [m²/s²]
