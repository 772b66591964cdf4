"""The legs' path through the flight: from the take-off pose to the tuck, and from there to the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerial_model.robot.robot import Robot
from aerial_planner.motion.schedule import Schedule
from aerial_planner.reference.landing import FOLDING_SPEED, Landing

_TUCKED_AT = 0.3  # share of the flight after which legs are tucked: early, as front feet meet a platform's edge first
_READY_AT = 0.9  # share of the flight after which they reach for the ground
_SMOOTH_STEP_PEAK = 1.5  # greatest slope of the smooth step


@dataclass(frozen=True, kw_only=True)
class FlightPath:
    """The legs' path through the flight: a smooth step to the tuck, one to the reach, then faster and faster to landing."""

    turning: int  # knot at which the legs are tucked
    ready: int  # knot at which they reach for the ground
    tuck: np.ndarray  # (n,) [rad]
    reach: np.ndarray  # (n,) [rad]
    landing: np.ndarray  # (n,) [rad]
    fraction: np.ndarray  # (M,) share of the remaining distance to the pose ahead covered in each interval
    settling_time: float  # in which the legs' rates of the take-off die out [s]

    def parameters(self, k: int) -> np.ndarray:
        """Return share of the flight time, fraction and pose ahead of interval ``k`` as one vector ``(2 + n,)``."""
        pose = self.tuck if k < self.turning else self.reach if k < self.ready else self.landing
        return np.concatenate([[1 / len(self.fraction), self.fraction[k]], pose])

    def onset(self, flight_time: float) -> tuple[float, float]:
        """Return how the legs accelerate as a flight of T begins: by −a q̇ + b / T² (tuck − q), as (a [1/s], b [-])."""
        folding = self.turning / len(self.fraction)
        return 4.0 / min(self.settling_time, flight_time), 6.0 / folding**2

    def at_knots(self, start: np.ndarray) -> np.ndarray:
        """Return joint positions ``(M+1, n)`` [rad] at the knots, from a take-off pose."""
        return self.at(start, np.linspace(0.0, 1.0, len(self.fraction) + 1), 1.0)[0]

    def at(self, start: np.ndarray, time: np.ndarray, flight_time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return joint positions [rad] and rates [rad/s] ``(K, n)`` at ``time`` ``(K,)`` [s] from a take-off pose."""
        dt = flight_time / len(self.fraction)
        time = np.asarray(time)[:, None]
        turning, ready = self.turning * dt, self.ready * dt
        up, up_rate = _smooth_step(time / turning)
        down, down_rate = _smooth_step((time - turning) / (ready - turning))
        left = flight_time - ready
        back, back_rate = _run_up((time - ready) / left)
        legs = self.tuck - start, self.reach - self.tuck, self.landing - self.reach
        position = start + up * legs[0] + down * legs[1] + back * legs[2]
        rate = up_rate / turning * legs[0] + down_rate / (ready - turning) * legs[1] + back_rate / left * legs[2]
        return position, rate

    def from_take_off(
        self, start: np.ndarray, start_rate: np.ndarray, time: np.ndarray, flight_time: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return joint positions [rad] and rates [rad/s] ``(K, n)`` of legs whose rates at take-off die out on the path.

        Args:
            start: take-off pose ``(n,)`` [rad].
            start_rate: joint rates there ``(n,)`` [rad/s].
            time: from take-off ``(K,)`` [s].
            flight_time: duration of the flight [s].
        """
        position, rate = self.at(start, time, flight_time)
        settling = min(self.settling_time, flight_time)
        s = np.clip(time / settling, 0.0, 1.0)[:, None]
        position = position + settling * s * (1 - s) ** 2 * start_rate
        rate = rate + (1 - s) * (1 - 3 * s) * start_rate
        return position, rate


def turning_knots(schedule: Schedule) -> tuple[int, int]:
    """Return the knots at which the legs are tucked, and at which they reach for the ground."""
    M = schedule.flight_knots
    ready = max(2, round(_READY_AT * M))
    folding = int(np.ceil(schedule.folding_time / schedule.flight_time * M))
    return min(max(_usual_turning(M), folding), ready - 1), ready


def flight_path(
    schedule: Schedule, robot: Robot, stretched: np.ndarray, landing: Landing, settling_time: float
) -> FlightPath:
    """Return the path that tucks as far as the legs can fold and stretch in time.

    Args:
        schedule: of the motion.
        robot: whose legs these are.
        stretched: take-off pose with the longest legs ``(n,)`` [rad].
        landing: how the legs meet the ground.
        settling_time: in which the legs' rates of the take-off die out [s].
    """
    reach = landing.reach
    turning, ready = turning_knots(schedule)
    M, dt = schedule.flight_knots, schedule.flight_time_range[0] / schedule.flight_knots
    travel = FOLDING_SPEED * robot.actuators.no_load_speed * dt / _SMOOTH_STEP_PEAK  # per interval (n,) [rad]
    fold = robot.poses["tuck"] - reach
    # As a share of the whole tuck; legs that fold slowly unfold no faster.
    depth = ((ready - turning) / (ready - _usual_turning(M))) ** 2
    for offset, intervals in ((reach - stretched, turning), (np.zeros_like(reach), ready - turning)):
        # |offset + depth · fold| ≤ travel · intervals, joint by joint
        headroom = np.sign(fold) * -offset + travel * intervals
        folding = np.abs(fold) > 0
        depth = min(depth, *np.clip(headroom[folding] / np.abs(fold[folding]), 0.0, 1.0))
    fraction = np.zeros(M)
    for first, last, course in ((0, turning, _smooth_step), (turning, ready, _smooth_step), (ready, M, _run_up)):
        covered, _ = course(np.linspace(0.0, 1.0, last - first + 1))
        fraction[first:last] = np.diff(covered) / (1 - covered[:-1])
    return FlightPath(
        turning=turning,
        ready=ready,
        tuck=reach + depth * fold,
        reach=reach,
        landing=landing.pose,
        fraction=fraction,
        settling_time=settling_time,
    )


def _usual_turning(M: int) -> int:
    return max(1, round(_TUCKED_AT * M))


def _smooth_step(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return 3s² − 2s³ and its derivative, s held to [0, 1]."""
    s = np.clip(s, 0.0, 1.0)
    return s**2 * (3 - 2 * s), 6 * s * (1 - s)


def _run_up(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return s² and its derivative, s held to [0, 1]."""
    s = np.clip(s, 0.0, 1.0)
    return s**2, 2 * s
