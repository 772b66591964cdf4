"""Trajectories at the knots: results of an optimization stage, and guesses from which the next one starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class TakeOffTrajectory:
    """N + 1 take-off knots and M + 1 flight knots, in S (see ``aerial_model.values.plan``); SI units."""

    dt: np.ndarray  # (N,) from each knot to the next [s]
    com: np.ndarray  # (N+1, 3)
    com_velocity: np.ndarray  # (N+1, 3)
    angular_momentum: np.ndarray  # (N+1, 3)
    orientation: np.ndarray  # (N+1, 4)
    joint_position: np.ndarray  # (N+1, n)
    angular_velocity: np.ndarray  # (N+1, 3) in B, contacts held
    joint_velocity: np.ndarray  # (N+1, n)
    force: np.ndarray  # (N, n_c, 3)
    flight_time: float  # [s]
    flight_orientation: np.ndarray  # (M+1, 4)
    flight_joint_position: np.ndarray  # (M+1, n)
    flight_angular_velocity: np.ndarray  # (M, 3) in B
