"""What the robot's sensors say: the truth plus biases drawn once per seed and noise drawn per sample.

Nominal figures: FACTS of the Mini Cheetah's software simulator for the uniform noise (MIT Cheetah-Software,
``simulator-defaults.yaml``: attitude ±0.003 rad, gyro and accelerometer ±0.005); biases and joint-rate noise are this
project's, larger than the data sheets of the inertial unit (VN-100) and the encoders (AS5047P) promise.
A bias has its full size on every axis and joint and a random sign: no seed is an easy one.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from aerial_model import rotation
from aerial_model.errors import ConfigurationError
from aerial_model.robot import Robot


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
        n_joints: number of joints.
        random: source of biases and noise.
    """

    def __init__(self, noise: SensorNoise, n_joints: int, random: np.random.Generator) -> None:
        self._noise = noise
        self._random = random
        self._attitude_bias = self._signs(3) * noise.attitude_bias
        self._accelerometer_bias = self._signs(3) * noise.accelerometer_bias
        self._encoder_bias = self._signs(n_joints) * noise.encoder_bias

    def orientation(self, attitude: np.ndarray) -> np.ndarray:
        """Return the reported attitude ``(4,)`` of a base with the true one ``(4,)``, quaternions xyzw."""
        error = self._attitude_bias + self._uniform(3, self._noise.attitude_noise)
        return rotation.multiply(attitude, rotation.exp(error))

    def angular_velocity(self, velocity: np.ndarray) -> np.ndarray:
        """Return the gyro's reading ``(3,)`` [rad/s] in B."""
        return velocity + self._uniform(3, self._noise.gyro_noise)

    def linear_acceleration(self, specific_force: np.ndarray) -> np.ndarray:
        """Return the accelerometer's reading ``(3,)`` [m/s²] in B."""
        return specific_force + self._accelerometer_bias + self._uniform(3, self._noise.accelerometer_noise)

    def joint_position(self, position: np.ndarray) -> np.ndarray:
        """Return the encoders' reading ``(n,)`` [rad]."""
        return position + self._encoder_bias

    def joint_velocity(self, velocity: np.ndarray) -> np.ndarray:
        """Return the reported joint rates ``(n,)`` [rad/s]."""
        return velocity + self._random.normal(0.0, self._noise.joint_rate_noise, len(velocity))

    def _signs(self, n: int) -> np.ndarray:
        return self._random.choice([-1.0, 1.0], n)

    def _uniform(self, n: int, size: float) -> np.ndarray:
        return self._random.uniform(-size, size, n)
