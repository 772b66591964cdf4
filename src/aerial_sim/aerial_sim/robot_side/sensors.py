"""What the robot's sensors say: the truth plus biases drawn once per seed and noise drawn per sample.

Nominal figures: FACTS of the Mini Cheetah's software simulator for the uniform noise (MIT Cheetah-Software,
``simulator-defaults.yaml``: attitude ±0.003 rad, gyro and accelerometer ±0.005); biases and joint-rate noise are this
project's, larger than the data sheets of the inertial unit (VN-100) and the encoders (AS5047P) promise.
A bias has its full size on every axis and joint and a random sign: no seed is an easy one.

Off unless asked for: steps of the encoders (14 bits a turn of the motor for the AS5047P), play of the gears (0.005 rad at
the joint, B. Katz's figure) and an outside localization (millimetres; nobody has published a figure).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from aerial_model.errors import ConfigurationError
from aerial_model.numerics.components import exp_of, product_of, quaternion, vector
from aerial_model.numerics.jit import compiled
from aerial_model.robot.actuator import ActuatorLaw
from aerial_model.robot.robot import Robot

_ROUNDING = 1e-6  # periods of the localization: sums of control periods are not exact


@dataclass(frozen=True, kw_only=True)
class SensorNoise:
    """Sizes of the sensor errors, section ``sensors`` of ``robot.yaml``; ± is uniform, per sample and axis."""

    attitude_bias: float = 0.0052359878  # 0.3° about each axis of B [rad]
    attitude_noise: float = 0.003  # ± rotation vector in B [rad]
    gyro_noise: float = 0.005  # ± [rad/s]
    accelerometer_bias: float = 0.05  # [m/s²]
    accelerometer_noise: float = 0.005  # ± [m/s²]
    encoder_bias: float = 0.001  # [rad]
    joint_rate_noise: float = 0.05  # Gaussian, rms [rad/s]
    encoder_counts: float = 0.0  # in a turn of the motor; 0: no steps
    gear_backlash: float = 0.0  # from flank to flank, at the joint [rad]
    localization_rate: float = 0.0  # at which an outside source reports the base's position; 0: there is none [Hz]
    localization_noise: float = 0.0075  # Gaussian, rms, per axis [m]

    def __post_init__(self) -> None:
        for field in fields(self):
            if getattr(self, field.name) < 0:
                raise ValueError(f"{field.name} must not be negative, found {getattr(self, field.name)}")

    @staticmethod
    def of(robot: Robot, noise: str) -> SensorNoise:
        """Return the noise called ``"nominal"`` (the robot's own figures) or ``"off"``.

        Raises:
            ConfigurationError: for any other name.
        """
        if noise == "nominal":
            return robot.section("sensors", SensorNoise)
        if noise == "off":
            return SensorNoise(**{field.name: 0.0 for field in fields(SensorNoise)})
        raise ConfigurationError(f"noise: expected 'nominal' or 'off', found '{noise}'")


class Sensors:
    """Inertial unit and joint encoders with one draw of biases.

    Args:
        noise: sizes of the errors.
        law: of the motors, whose side of the gears the encoders are on.
        random: source of biases and noise.
    """

    def __init__(self, noise: SensorNoise, law: ActuatorLaw, random: np.random.Generator) -> None:
        self._noise = noise
        self._random = random
        self._attitude_bias = self._signs(3) * noise.attitude_bias
        self._accelerometer_bias = self._signs(3) * noise.accelerometer_bias
        self._encoder_bias = self._signs(len(law.gear_ratio)) * noise.encoder_bias
        self._encoder_step = 2 * np.pi / (noise.encoder_counts * law.gear_ratio) if noise.encoder_counts else None
        self._dry_friction = law.dry_friction
        self._flank = np.zeros(len(law.gear_ratio))  # −1 or 1: to which side the motors press the gears' teeth
        self._fixes = 0  # positions reported by the outside source

    def orientation(self, attitude: np.ndarray) -> np.ndarray:
        """Return the reported attitude ``(4,)`` of a base with the true one ``(4,)``, quaternions xyzw."""
        error = self._attitude_bias + self._uniform(3, self._noise.attitude_noise)
        return _turned(attitude, error)

    def angular_velocity(self, velocity: np.ndarray) -> np.ndarray:
        """Return the gyro's reading ``(3,)`` [rad/s] in B."""
        return velocity + self._uniform(3, self._noise.gyro_noise)

    def linear_acceleration(self, specific_force: np.ndarray) -> np.ndarray:
        """Return the accelerometer's reading ``(3,)`` [m/s²] in B."""
        return specific_force + self._accelerometer_bias + self._uniform(3, self._noise.accelerometer_noise)

    def joint_position(self, position: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Return the encoders' reading ``(n,)`` [rad].

        Args:
            position: of the joints ``(n,)`` [rad].
            torque: of the motors ``(n,)``; what overcomes dry friction moves them through the gears' play [N·m].
        """
        of_motor = position
        if self._noise.gear_backlash:
            pressing = np.abs(torque) > self._dry_friction
            self._flank[pressing] = np.sign(torque[pressing])
            of_motor = position + self._noise.gear_backlash / 2 * self._flank
        if self._encoder_step is not None:
            of_motor = self._encoder_step * np.round(of_motor / self._encoder_step)
        return of_motor + self._encoder_bias

    def joint_velocity(self, velocity: np.ndarray) -> np.ndarray:
        """Return the reported joint rates ``(n,)`` [rad/s]."""
        return velocity + self._random.normal(0.0, self._noise.joint_rate_noise, len(velocity))

    def localization(self, time: float, position: np.ndarray) -> np.ndarray | None:
        """Return the outside source's report of a position ``(3,)`` [m]; None if none is due at ``time`` [s]."""
        if time * self._noise.localization_rate < self._fixes - _ROUNDING or not self._noise.localization_rate:
            return None
        self._fixes += 1
        return position + self._random.normal(0.0, self._noise.localization_noise, 3)

    def _signs(self, n: int) -> np.ndarray:
        return self._random.choice([-1.0, 1.0], n)

    def _uniform(self, n: int, size: float) -> np.ndarray:
        return size * (2.0 * self._random.random(n) - 1.0)


@compiled
def _turned(attitude: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Return a quaternion ``(4,)`` turned by a rotation vector ``(3,)`` [rad] in the body."""
    return np.array(product_of(quaternion(attitude), exp_of(vector(error))))
