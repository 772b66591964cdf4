"""Every number the controller is tuned by, section ``controller`` of ``robot.yaml``; one set for all motions."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, kw_only=True)
class Feedback:
    """Gains of one task, thesis (3.22)."""

    stiffness: float  # K_p [1/s²]
    damping: float  # K_d [1/s]

    def __post_init__(self) -> None:
        if not (self.stiffness >= 0 and self.damping > 0):
            raise ValueError(f"stiffness must not be negative and damping must be positive, found {self}")

    @property
    def rate(self) -> float:
        """K_p / K_d, the rate at which the feedback closes a gap [1/s]."""
        return self.stiffness / self.damping


@dataclass(frozen=True, kw_only=True)
class BodyGains:
    """Gains of the floating base task, (3.27)."""

    position: Feedback
    attitude: Feedback


@dataclass(frozen=True, kw_only=True)
class EstimatorNoise:
    """What the estimator assumes about its sources; standard deviations."""

    acceleration: float  # of the measured base acceleration, per sample [m/s²]
    foot_drift: float  # of a loaded contact point, random walk [m/√s]
    foot_position: float  # of forward kinematics [m]
    foot_velocity: float  # of forward kinematics, joint-rate noise included [m/s]
    touchdown_time: float  # after a scheduled touchdown for which contact points are believed less [s]
    localization: float  # of a measured base position [m]
    attitude_time: float  # time constant that draws the integrated gyro to the reported attitude [s]

    def __post_init__(self) -> None:
        for field in fields(self):
            if not getattr(self, field.name) > 0:
                raise ValueError(f"{field.name} must be positive, found {getattr(self, field.name)}")


@dataclass(frozen=True, kw_only=True)
class ControllerGains:
    """Gains, weights, durations and thresholds."""

    follow: BodyGains  # while a plan runs
    hold: BodyGains  # landing and standing
    swing_joint: Feedback  # joints of limbs in the air, task 0
    angular_momentum_damping: float  # K_d,CAM of (3.29) [1/s]
    weight_base: float  # Q_1 of (3.24) [1/(m/s²)²]
    weight_force: float  # Q_2 of (3.24) [1/N²]
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
    start_speed_tolerance: float  # of the centre of mass when a plan is accepted [m/s]
    estimator: EstimatorNoise

    def __post_init__(self) -> None:
        _check_not_negative(self)
        for name in (
            "weight_base",
            "weight_force",
            "stiction_speed",
            "settling_rate",
            "landing_depth",
            "landing_turn",
            "lying_rate",
        ):
            if getattr(self, name) == 0:
                raise ValueError(f"{name} must be positive, found 0")


def _check_not_negative(section: object) -> None:
    for field in fields(section):  # type: ignore[arg-type]
        value = getattr(section, field.name)
        if isinstance(value, float) and value < 0:
            raise ValueError(f"{field.name} must not be negative, found {value}")
