"""The flight, integrated finely: α is conserved, the legs move along their path and turn the body against them."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from aerial_model import rotation
from aerial_planner.reference import FlightPath
from aerial_planner.symbolic import BaseFrameModel

SETTLING_TIME = 0.08  # in which the joint rates of the take-off die out [s]
_STEP = 0.005  # of the fourth-order integration [s]


@dataclass(frozen=True, kw_only=True)
class Flight:
    """The flight at K times from take-off to touchdown, in S."""

    time: np.ndarray  # (K,) from take-off [s]
    orientation: np.ndarray  # (K, 4)
    angular_velocity: np.ndarray  # (K, 3) in B [rad/s]
    joint_position: np.ndarray  # (K, n) [rad]
    joint_velocity: np.ndarray  # (K, n) [rad/s]


def integrate_flight(
    model: BaseFrameModel,
    path: FlightPath,
    *,
    orientation: np.ndarray,
    angular_momentum: np.ndarray,
    joint_position: np.ndarray,
    joint_velocity: np.ndarray,
    step: float = _STEP,
) -> Flight:
    """Return the flight from a take-off state, by a fourth-order Runge–Kutta rule.

    The legs follow ``path``; the joint rates they leave the ground with fade out on top of it, as no motor stops at once.

    Args:
        model: the robot's base-frame functions.
        path: the legs' path.
        orientation: of the base at take-off ``(4,)``.
        angular_momentum: α ``(3,)`` in S [kg·m²/s].
        joint_position: at take-off ``(n,)`` [rad].
        joint_velocity: at take-off ``(n,)`` [rad/s].
        step: of the integration and of the returned samples [s], shortened so that it divides the flight.
    """
    duration = path.dt * len(path.fraction)
    n = max(1, round(duration / step))
    h = duration / n
    half_times = np.linspace(0.0, duration, 2 * n + 1)
    q_j, dq_j = _legs(path, joint_position, joint_velocity, half_times)
    count = len(half_times)
    inertia = np.asarray(model.inertia.map(count)(q_j.T)).T.reshape(count, 3, 3)  # symmetric
    legs_momentum = np.asarray(model.angular_momentum.map(count)(q_j.T, ca.DM.zeros(3, count), dq_j.T)).T
    inertia_inverse = np.linalg.inv(inertia)

    def rate(i: int, quaternion: np.ndarray) -> np.ndarray:
        return inertia_inverse[i] @ (rotation.matrix(quaternion).T @ angular_momentum - legs_momentum[i])

    attitudes, rates = [np.asarray(orientation)], [rate(0, orientation)]
    for k in range(n):
        start, i = attitudes[-1], 2 * k
        w_1 = rates[-1]
        w_2 = rate(i + 1, rotation.multiply(start, rotation.exp(0.5 * h * w_1)))
        w_3 = rate(i + 1, rotation.multiply(start, rotation.exp(0.5 * h * w_2)))
        w_4 = rate(i + 2, rotation.multiply(start, rotation.exp(h * w_3)))
        mean = (w_1 + 2 * w_2 + 2 * w_3 + w_4) / 6
        end = rotation.multiply(start, rotation.exp(h * mean))
        attitudes.append(end / np.linalg.norm(end))
        rates.append(rate(i + 2, attitudes[-1]))
    return Flight(
        time=half_times[::2],
        orientation=np.array(attitudes),
        angular_velocity=np.array(rates),
        joint_position=q_j[::2],
        joint_velocity=dq_j[::2],
    )


def _legs(
    path: FlightPath, start: np.ndarray, start_rate: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return joint positions and rates ``(K, n)`` along the path at ``times`` ``(K,)``."""
    position, rate = path.at(start, times)
    tau = min(SETTLING_TIME, path.dt * len(path.fraction))
    s = np.clip(times / tau, 0.0, 1.0)[:, None]
    position = position + tau * s * (1 - s) ** 2 * start_rate
    rate = rate + (1 - s) * (1 - 3 * s) * start_rate
    return position, rate
