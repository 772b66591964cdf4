"""Did it land? The project's one definition, decided from ground truth; the controller's opinion is not asked.

One thing only the controller can know is taken from it, and can only spoil a landing: in which ticks it fell back.
Controllers ask for what a motion needs, also beyond a limit; the drives limit it, and the simulator records the wish.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from aerial_evaluation.record import IncompleteRunError, Run, Tick
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ANGULAR, BASE_LINEAR, BASE_ORIENTATION, Robot
from aerial_model.values.plan import Plan
from aerial_sim.ground_truth import GroundTruth

SETTLE_TIME = 0.3  # after the planned landing only contact points may touch from here … [s]
OBSERVE_TIME = 1.5  # … to here, where the final state is judged [s]
AIRBORNE_FRACTION = 0.5  # of the planned flight
TILT_MAX = np.radians(10.0)  # [rad]
HEIGHT_TOLERANCE = 0.2  # of the commanded height of the centre of mass
SPEED_MAX = 0.1  # of the base [m/s]
ROTATION_TOLERANCE = np.radians(15.0)  # [rad]
POSITION_TOLERANCE = 0.05  # [m] for a jump on the spot …
POSITION_TOLERANCE_PER_DISTANCE = 0.15  # … growing with its length …
POSITION_TOLERANCE_MAX = 0.15  # … up to this [m]
SATURATED_FRACTION = 0.01  # of the ticks


@dataclass(frozen=True, kw_only=True)
class Landing:
    """The verdict, each condition by itself, and the figures behind it."""

    checks: dict[str, bool]  # condition → whether it holds
    tilt: float  # at the end [rad]
    height: float  # of the centre of mass above the landing surface at the end [m]
    position_error: float  # horizontal, of the support centre at the end [m]
    rotation: np.ndarray  # (3,) ∫ω dt from start to touchdown, in the start heading frame [rad]
    rotation_error: float  # its distance from the plan's [rad]
    apex: float  # highest centre of mass above the ground at the start [m]
    peak_torque_ratio: float  # requested over limit, over all joints and physics steps
    peak_voltage_ratio: float

    @property
    def landed(self) -> bool:
        """Whether every condition holds."""
        return all(self.checks.values())

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the conditions that do not hold."""
        return tuple(name for name, holds in self.checks.items() if not holds)

    def to_json(self) -> dict[str, Any]:
        """Return the figures as ``./aerial simulate --json`` prints them."""
        return {
            "landed": self.landed,
            "checks": dict(self.checks),
            "tilt_deg": float(np.degrees(self.tilt)),
            "height_m": self.height,
            "position_error_m": self.position_error,
            "rotation_deg": np.degrees(self.rotation).tolist(),
            "rotation_error_deg": float(np.degrees(self.rotation_error)),
            "apex_m": self.apex,
            "peak_torque_ratio": self.peak_torque_ratio,
            "peak_voltage_ratio": self.peak_voltage_ratio,
        }


def judge(run: Run) -> Landing:
    """Return the verdict on one motion, from its start to ``OBSERVE_TIME`` after its planned landing.

    What a run recorded before or after is left out.

    Raises:
        IncompleteRunError: if the run does not cover that time.
    """
    robot, plan, frame = run.robot, run.plan, run.start_frame
    ticks, period = _window(run, run.start_time + plan.landing_time + OBSERVE_TIME)
    truths = [tick.truth for tick in ticks]
    final = truths[-1]
    landing = run.start_time + plan.landing_time
    settled = [truth for truth in truths if truth.time > landing + SETTLE_TIME - period / 2]
    placed = plan.placed(frame)

    airborne, touchdown = _longest_flight(np.array([truth.contact.any() for truth in truths]))
    if airborne == 0:
        touchdown = int(np.searchsorted([truth.time for truth in truths], landing))
    turned = _accumulated_rotation(truths[: touchdown + 1])
    com_height = np.array([_centre_of_mass(robot, truth.q)[2] for truth in truths])
    height = float(com_height[-1] - placed.landing_support_centre[2] - run.conditions.ground_rise)
    support = robot.contact_positions(final.q).mean(axis=0)
    position_error = float(np.linalg.norm((support - placed.landing_support_centre)[:2]))
    tilt = rotation.tilt(final.q[BASE_ORIENTATION])
    rotation_error = float(np.linalg.norm(turned - placed.rotation))
    beyond = [max(truth.peak_torque_ratio, truth.peak_voltage_ratio) > 1 for truth in truths]
    checks = {
        "airborne": airborne * period >= AIRBORNE_FRACTION * (plan.landing_time - plan.take_off_time),
        "trunk_clear": not any(truth.trunk_contact for truth in truths),
        "feet_only": not any(truth.other_contacts for truth in settled),
        "upright": tilt <= TILT_MAX,
        "height": abs(height - plan.landing_com_height) <= HEIGHT_TOLERANCE * plan.landing_com_height,
        "at_rest": np.linalg.norm(final.v[BASE_LINEAR]) <= SPEED_MAX,
        "rotation": rotation_error <= ROTATION_TOLERANCE,
        "position": position_error <= position_tolerance(plan),
        "within_limits": np.mean(beyond) <= SATURATED_FRACTION,
        "no_fallback": not any(tick.fallback for tick in ticks),
    }
    return Landing(
        checks={name: bool(holds) for name, holds in checks.items()},
        tilt=tilt,
        height=height,
        position_error=position_error,
        rotation=frame.R_SW @ turned,
        rotation_error=rotation_error,
        apex=float(com_height.max() - frame.origin[2]),
        peak_torque_ratio=max(truth.peak_torque_ratio for truth in truths),
        peak_voltage_ratio=max(truth.peak_voltage_ratio for truth in truths),
    )


def position_tolerance(plan: Plan) -> float:
    """Return the horizontal landing error [m] that a jump may have: it grows with the planned distance."""
    distance = float(np.linalg.norm(plan.landing_support_centre[:2]))
    return min(POSITION_TOLERANCE_MAX, POSITION_TOLERANCE + POSITION_TOLERANCE_PER_DISTANCE * distance)


def _window(run: Run, end: float) -> tuple[list[Tick], float]:
    """Return the ticks from the run's start to ``end`` [s], both included, and the control period [s]."""
    start = run.start_time
    if not run.ticks:
        raise IncompleteRunError(f"a landing is judged from {start:.3f} s to {end:.3f} s; the run has no true states")
    first, last = run.ticks[0].truth.time, run.ticks[-1].truth.time
    period = (last - first) / max(len(run.ticks) - 1, 1)
    if first > start + period or last < end - period:
        raise IncompleteRunError(
            f"a landing is judged from {start:.3f} s to {end:.3f} s; the true states cover {first:.3f} s to {last:.3f} s"
        )
    return [tick for tick in run.ticks if start - period / 2 <= tick.truth.time <= end + period / 2], period


def _longest_flight(on_ground: np.ndarray) -> tuple[int, int]:
    """Return the length in ticks of the longest stretch without contact, and the index of the tick that ends it."""
    touching = np.flatnonzero(np.concatenate([[True], on_ground, [True]])) - 1
    gaps = np.diff(touching) - 1
    longest = int(np.argmax(gaps))
    return int(gaps[longest]), min(int(touching[longest + 1]), len(on_ground) - 1)


def _accumulated_rotation(truths: list[GroundTruth]) -> np.ndarray:
    """Return ∫ω dt ``(3,)`` [rad], ω in W, by the trapezoidal rule."""
    time = np.array([truth.time for truth in truths])
    omega = np.array([rotation.matrix(truth.q[BASE_ORIENTATION]) @ truth.v[BASE_ANGULAR] for truth in truths])
    return np.trapezoid(omega, time, axis=0)


def _centre_of_mass(robot: Robot, q: np.ndarray) -> np.ndarray:
    return pin.centerOfMass(robot.model, robot.model.createData(), q)
