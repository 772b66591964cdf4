"""Every number and choice the controller is tuned by: one set for all motions, and but for scale for all robots.

They are those of ``gains.yaml``, scaled to the robot, unless section ``controller`` of ``robot.yaml`` says otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from enum import StrEnum
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from aerial_model.config import load_yaml
from aerial_model.robot.scale import Scale, Unit

_RATE = Unit(time=-1)
# How numbers of gains.yaml grow with the robot. The estimator's are the sensors' and the floor's: they stay.
_UNITS = {
    "posture_stiffness": Unit(mass=1, length=2, time=-2),
    "joint_damping": Unit(mass=1, length=2, time=-1),
    "stop_damping": Unit(mass=1, length=2, time=-1),
    "stiffness": Unit(time=-2),
    "damping": _RATE,
    "angular_momentum_damping": _RATE,
    "weight_base": Unit(length=-2, time=4),
    "weight_force": Unit(mass=-2, length=-2, time=4),
    "settling_rate": _RATE,
    "landing_depth": Unit(length=1),
    "lying_height": Unit(length=1),
    "lying_rate": _RATE,
    "start_speed_tolerance": Unit(length=1, time=-1),
    "start_velocity_tolerance": Unit(length=1, time=-1),
    "start_momentum_tolerance": Unit(mass=1, length=2, time=-1),
}


class Feedback(NamedTuple):
    """Gains of one task, thesis (3.22)."""

    stiffness: float  # K_p [1/s²]
    damping: float  # K_d [1/s]


class BodyGains(NamedTuple):
    """Gains of the floating base task, (3.27)."""

    position: Feedback
    attitude: Feedback


class TaskOrder(StrEnum):
    """Which tasks the accelerations come from: in strict priority, or all at once with weights.

    Where a leg has joints to spare, they follow the plan below the base. Without spare joints and arms WBC_A and WBC_C are
    the same: limbs and base leave nothing to what is below them.
    """

    WBC_A = "wbc_a"  # limbs, base, angular momentum: the thesis's
    WBC_B = "wbc_b"  # limbs, momentum
    WBC_C = "wbc_c"  # limbs, base, joint positions
    WEIGHTED = "weighted"  # those of WBC_A, in one least-squares problem


class TaskWeights(NamedTuple):
    """Weights of ``TaskOrder.WEIGHTED``, per squared unit of each task's acceleration."""

    limbs: float = 1e4  # [1/(m/s²)²], [1/(rad/s²)²]
    base: float = 100.0  # [1/(m/s²)²], [1/(rad/s²)²]
    spare_joints: float = 1.0  # [1/(rad/s²)²]
    angular_momentum: float = 1.0  # [1/(m/s²)²]


class QpSolver(StrEnum):
    """What solves the quadratic program."""

    OSQP = "osqp"
    DAQP = "daqp"


class Touchdown(StrEnum):
    """What ends the flight."""

    TIME = "time"  # the planned landing time, as in the thesis
    CONTACT = "contact"  # contacts that are felt, early or late


class TouchdownSensing(NamedTuple):
    """How contacts are felt in flight, for ``Touchdown.CONTACT``."""

    share_of_weight: float = 0.1  # that a point bears which counts as touching
    filter_time: float = 0.006  # time constant that takes the joint rates' noise away [s]
    patience: float = 0.1  # after the planned landing, for which a contact is waited for [s]


class EstimatorNoise(NamedTuple):
    """What the estimator assumes about its sources; standard deviations."""

    acceleration: float  # of the measured base acceleration, per sample [m/s²]
    foot_drift: float  # of a loaded contact point, random walk [m/√s]
    foot_position: float  # of forward kinematics [m]
    foot_velocity: float  # of forward kinematics, joint-rate noise included [m/s]
    touchdown_time: float  # after a scheduled touchdown for which contact points are believed less [s]
    localization: float  # of a measured base position [m]
    attitude_time: float  # time constant that draws the integrated gyro to the reported attitude [s]
    foot_velocity_share: float = 0.0  # of the speed, by which a wrong attitude makes the legs' velocity wrong


@dataclass(frozen=True, kw_only=True)
class ControllerGains:
    """Gains, weights, durations, thresholds and choices."""

    follow: BodyGains  # while a plan runs
    hold: BodyGains  # landing and standing
    swing_joint: Feedback  # joints of limbs in the air, task 0
    angular_momentum_damping: float  # K_d,CAM of (3.29) [1/s]
    weight_base: float  # Q_1 of (3.24) [1/(m/s²)²]
    weight_force: float  # Q_2 of (3.24) [1/N²]
    actuator_share: float  # of torque and voltage limits that limbs under load may be asked for
    joint_damping: float  # rides along on the motor boards [N·m·s/rad]
    posture_stiffness: float  # of the joints while the legs are folded to stand up [N·m/rad]
    stop_damping: float  # of the joints when stopped or lying [N·m·s/rad]
    stiction_speed: float  # width of the friction feed-forward's sign change [rad/s]
    settling_rate: float  # at which motion dies away after touchdown and at the first measurement [1/s]
    landing_depth: float  # to which the centre of mass sinks while it is caught [m]
    landing_turn: float  # to which the base turns on while it is caught [rad]
    lying_height: float  # of the centre of mass above the ground where the joints are let go [m]
    lying_rate: float  # at which the robot sinks to it, and at which it folds its legs [1/s]
    fall_tilt: float  # of the base; beyond it the robot has fallen, except in a motion [rad]
    start_joint_tolerance: float  # between a plan's first joint position and the measured one [rad]
    start_tilt_tolerance: float  # between a plan's first base attitude and the estimated one [rad]
    start_speed_tolerance: float  # of the base when a plan that begins at rest is accepted [m/s]
    start_velocity_tolerance: float  # of the base, from that of a plan that begins in motion [m/s]
    start_momentum_tolerance: float  # of the angular momentum, from that of a plan that begins in motion [kg·m²/s]
    estimator: EstimatorNoise
    tasks: TaskOrder = TaskOrder.WBC_C
    task_weights: TaskWeights = field(default=TaskWeights())
    qp_solver: QpSolver = QpSolver.OSQP
    touchdown: Touchdown = Touchdown.TIME
    touchdown_sensing: TouchdownSensing = field(default=TouchdownSensing())

    @staticmethod
    def defaults(scale: Scale) -> dict[str, Any]:
        """Return what a ``robot.yaml`` need not say: the reference robot's gains, scaled."""
        return scale.applied(load_yaml(Path(str(resources.files("aerial_wbic"))) / "gains.yaml"), _UNITS)

    def __post_init__(self) -> None:
        for path, value in _numbers(self):
            may_be_zero = path.split(".")[-1] in _MAY_BE_ZERO
            if value < 0 or (value == 0 and not may_be_zero):
                raise ValueError(f"{path} must {'not be negative' if may_be_zero else 'be positive'}, found {value}")


_MAY_BE_ZERO = ("stiffness", "angular_momentum_damping", "joint_damping", "stop_damping", "foot_velocity_share")


def _numbers(section: Any) -> Iterator[tuple[str, float]]:
    """Yield the path and value of every number, those of nested gains included."""
    names = getattr(section, "_fields", None) or [field.name for field in fields(section)]
    for name in names:
        value = getattr(section, name)
        if isinstance(value, float):
            yield name, value
        elif not isinstance(value, StrEnum):
            yield from ((f"{name}.{path}", number) for path, number in _numbers(value))
