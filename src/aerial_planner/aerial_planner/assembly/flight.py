"""The flight, integrated finely: α is conserved, the legs move along their path and turn the body against them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.interpolate import make_interp_spline

from aerial_model.numerics.components import matrix_of, product_of, quaternion
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.rotation import IDENTITY
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.reference.flight_path import FlightPath

_STEP = 0.005  # of the fourth-order integration [s]


@dataclass(frozen=True, kw_only=True)
class Flight:
    """The flight at K times from take-off to touchdown, in S."""

    time: np.ndarray  # (K,) from take-off [s]
    orientation: np.ndarray  # (K, 4)
    angular_velocity: np.ndarray  # (K, 3) in B [rad/s]
    joint_position: np.ndarray  # (K, n) [rad]
    joint_velocity: np.ndarray  # (K, n) [rad/s]


@dataclass(frozen=True, kw_only=True)
class LiftOff:
    """The state from which a flight begins, in S."""

    orientation: np.ndarray  # (4,) of the base
    angular_momentum: np.ndarray  # (3,) α [kg·m²/s]
    joint_position: np.ndarray  # (n,) [rad]
    joint_velocity: np.ndarray  # (n,) [rad/s]


@dataclass(frozen=True, kw_only=True)
class ArmCourse:
    """Where the joints that are free in flight go."""

    joints: np.ndarray  # (n_a,) their indices
    position: np.ndarray  # (M+1, n_a) at evenly spaced knots from take-off to touchdown [rad]


def integrate_flight(
    model: BaseFrameModel,
    path: FlightPath,
    lift_off: LiftOff,
    arms: ArmCourse,
    *,
    duration: float,
    step: float = _STEP,
) -> Flight:
    """Return the flight from a take-off state, by the classical Runge–Kutta rule on the quaternion.

    The legs follow ``path``; the joint rates they leave the ground with fade out on top of it, as no motor stops at once.
    The arms move at the mean rates of the intervals between knots, from one to the next with constant acceleration.

    Args:
        model: the robot's base-frame functions.
        path: the legs' path.
        lift_off: where the flight begins.
        arms: joints that do not follow the path.
        duration: of the flight [s].
        step: of the integration and of the returned samples [s], shortened so that it divides the flight.
    """
    n = max(1, round(duration / step))
    h = duration / n
    half_times = np.linspace(0.0, duration, 2 * n + 1)
    q_j, dq_j = path.from_take_off(lift_off.joint_position, lift_off.joint_velocity, half_times, duration)
    if len(arms.joints) > 0:
        start, rate = lift_off.joint_position[arms.joints], lift_off.joint_velocity[arms.joints]
        dt = duration / (len(arms.position) - 1)
        rates = np.diff(arms.position, axis=0) / dt
        times = np.concatenate([[0.0], (np.arange(len(rates)) + 0.5) * dt, [duration]])
        course = make_interp_spline(times, np.vstack([rate, rates, rates[-1:]]), k=1)
        dq_j[:, arms.joints] = course(half_times)
        q_j[:, arms.joints] = start + course.antiderivative()(half_times)
    inertia, legs_momentum = model.momenta(q_j, dq_j)
    attitude, omega = _turned(
        h, np.linalg.inv(inertia), legs_momentum, lift_off.angular_momentum.copy(), lift_off.orientation.copy()
    )
    return Flight(
        time=half_times[::2],
        orientation=attitude,
        angular_velocity=omega,
        joint_position=q_j[::2],
        joint_velocity=dq_j[::2],
    )


@cache
def rehearse() -> None:
    """Run what Numba compiles once, so that no plan waits for it."""
    _turned(0.1, np.zeros((3, 3, 3)), np.zeros((3, 3)), np.zeros(3), np.array(IDENTITY))


@compiled
def _turned(
    h: float, inertia_inverse: np.ndarray, legs_momentum: np.ndarray, alpha: np.ndarray, orientation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return attitudes ``(n+1, 4)`` and body rates ``(n+1, 3)`` at every other one of 2 n + 1 times half a step apart."""
    n = len(legs_momentum) // 2
    attitude, omega = np.empty((n + 1, 4)), np.empty((n + 1, 3))
    q = orientation.copy()
    slopes = np.empty((4, 4))
    for k in range(n):
        attitude[k] = q
        omega[k] = _rate(q, inertia_inverse[2 * k], legs_momentum[2 * k], alpha)
        for stage, (share, late) in enumerate(((0.0, 0), (0.5, 1), (0.5, 1), (1.0, 2))):
            p = q if stage == 0 else q + share * h * slopes[stage - 1]
            w = _rate(p / np.linalg.norm(p), inertia_inverse[2 * k + late], legs_momentum[2 * k + late], alpha)
            slope = product_of(quaternion(p), (w[0], w[1], w[2], 0.0))
            for i in range(4):
                slopes[stage, i] = 0.5 * slope[i]
        q = q + h / 6 * (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3])
        q = q / np.linalg.norm(q)
    attitude[n] = q
    omega[n] = _rate(q, inertia_inverse[2 * n], legs_momentum[2 * n], alpha)
    return attitude, omega


@compiled
def _rate(q: np.ndarray, inertia_inverse: np.ndarray, legs_momentum: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Return the body rate ``(3,)`` that makes up the angular momentum alpha together with the legs."""
    R = matrix_of(quaternion(q))
    left = np.empty(3)
    for i in range(3):
        left[i] = -legs_momentum[i]
        for j in range(3):
            left[i] += R[j][i] * alpha[j]
    omega = np.zeros(3)
    for i in range(3):
        for j in range(3):
            omega[i] += inertia_inverse[i, j] * left[j]
    return omega
