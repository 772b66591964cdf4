"""Where the robot is and how fast, from inertial unit and joint encoders: a contact-aided Kalman filter.

The attitude comes from the inertial unit; the gyro carries it between samples and a slow correction draws it to what
the unit reports. Given the attitude, position and velocity of the base and the positions of the contact points on the
ground obey a linear model; noise is taken to be the same in all directions, so the three axes of W share one covariance
and one gain: the state is a matrix X ``(2 + n_c, 3)`` with rows [p, v, c_1 …], the covariance P is
``(2 + n_c, 2 + n_c)``.

    ṗ = v,   v̇ = R f + g + w_a,   ċ_i = u_i + w_c    f: specific force the accelerometer reads
    0 = p + R p_i(q_j) − c_i + w_p                    p_i: centre of contact sphere i in B
    u_i = v + R (ω × p_i + ṗ_i) + w_v                 u_i: velocity of a centre whose sphere rolls

Only loaded points are measured. Where a point touches down is where forward kinematics says it does: nothing is
assumed about the height of the ground. A loaded point that moves against the filter's belief (not yet down, slipping) is
believed less in proportion: its noise grows with the square of the disagreement, and it is anchored anew. So is, for a
moment, every point that the schedule has just put on the ground.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from aerial_model import rotation
from aerial_model.robot import BASE_ANGULAR, BASE_ORIENTATION, JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_model.state import Estimate, Measurement
from aerial_wbic.gains import EstimatorNoise
from aerial_wbic.target import GRAVITY

P, V = 0, 1  # rows of X
FEET = slice(2, None)
_INSTANT = 1e-3  # [s] less than a period
_GATE = 4.0  # squared disagreement, in variances, from which a point is believed less


class Estimator:
    """Kalman filter over one robot's base and contact points.

    Args:
        robot: the robot.
        noise: what is assumed about the sensors.
    """

    def __init__(self, robot: Robot, noise: EstimatorNoise) -> None:
        self._robot = robot
        self._noise = noise
        self._data = robot.model.createData()
        self._q = np.zeros(robot.model.nq)  # base at the origin
        self._v = np.zeros(robot.model.nv)
        self._rows_of: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}  # by contacts
        self._radius = np.array([point.radius for point in robot.contact_points])  # (n_c,) [m]
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next measurement puts the centre of the support at the origin of W."""
        self._time: float | None = None

    @property
    def position_variance(self) -> float:
        """Of the base position along any axis of W [m²]."""
        return float(self._P[P, P])

    @property
    def velocity_variance(self) -> float:
        """Of the base velocity along any axis of W [m²/s²]."""
        return float(self._P[V, V])

    def update(self, measurement: Measurement, contact: np.ndarray) -> Estimate:
        """Return the estimate at the measurement's time.

        Args:
            measurement: of the robot.
            contact: points the schedule has on the ground ``(n_c,)`` bool.
        """
        if self._time is None:
            self._begin(measurement)
        else:
            self._predict(measurement)
        self._loaded_since[~contact] = measurement.time
        offset, offset_velocity, roll = self._forward_kinematics(measurement)
        self._correct(offset, offset_velocity, roll, contact)
        if measurement.localization is not None:
            self._correct_position(measurement.localization)
        return self._estimate(measurement)

    def _begin(self, measurement: Measurement) -> None:
        self._orientation = measurement.orientation
        offset, _, roll = self._forward_kinematics(measurement)
        n_c = len(offset)
        self._X = np.zeros((2 + n_c, 3))
        self._X[P] = [0.0, 0.0, self._radius.mean()] - offset.mean(axis=0)
        self._P = np.diag([0.0, self._noise.foot_velocity**2, *np.zeros(n_c)])
        self._feet = np.arange(2, 2 + n_c)
        self._loaded_since = np.full(n_c, -np.inf)  # a robot that is switched on stands firmly
        self._roll = roll
        for i in range(n_c):
            self._anchor(i, offset[i])
        self._remember(measurement)

    def _predict(self, measurement: Measurement) -> None:
        dt = measurement.time - self._time
        half_turn = rotation.exp((measurement.angular_velocity + self._gyro) * dt / 4)
        midway = rotation.multiply(self._orientation, half_turn)
        # The accelerometer reports the mean over the interval: it acts at the attitude half-way.
        a = rotation.matrix(midway) @ measurement.linear_acceleration + GRAVITY
        pull = min(dt / self._noise.attitude_time, 1.0)
        self._orientation = _drawn(rotation.multiply(midway, half_turn), measurement.orientation, pull)
        X, P_, noise = self._X, self._P, self._noise
        X[P] += X[V] * dt + a * dt**2 / 2
        X[V] += a * dt
        X[FEET] += self._roll * dt
        P_[P] += dt * P_[V]  # F P Fᵀ
        P_[:, P] += dt * P_[:, V]
        push = noise.acceleration**2 * dt**2
        P_[P, P] += push * dt**2 / 4
        P_[P, V] += push * dt / 2
        P_[V, P] += push * dt / 2
        P_[V, V] += push
        P_[self._feet, self._feet] += noise.foot_drift**2 * dt
        self._remember(measurement)

    def _remember(self, measurement: Measurement) -> None:
        self._time = measurement.time
        self._gyro = measurement.angular_velocity

    def _forward_kinematics(self, measurement: Measurement) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return R p_i, R (ω × p_i + ṗ_i) and u_i in W's axes, ``(n_c, 3)`` each.

        A sphere that rolls without slip on level ground has its centre moving at ω_i × (0, 0, radius), with ω_i the
        angular velocity of its link: at take-off 2 cm/s.
        """
        q, v = self._q, self._v
        q[BASE_ORIENTATION] = self._orientation
        q[JOINT_POSITION] = measurement.joint_position
        v[BASE_ANGULAR] = measurement.angular_velocity
        v[JOINT_VELOCITY] = measurement.joint_velocity
        model, data = self._robot.model, self._data
        pin.forwardKinematics(model, data, q, v)
        frames = self._robot.contact_frames
        offset = np.array([pin.updateFramePlacement(model, data, frame).translation for frame in frames])
        axes = pin.LOCAL_WORLD_ALIGNED
        twist = np.array([pin.getFrameVelocity(model, data, frame, axes).vector for frame in frames])  # (n_c, 6)
        roll = np.zeros_like(offset)
        roll[:, 0], roll[:, 1] = twist[:, 4] * self._radius, -twist[:, 3] * self._radius
        return offset, twist[:, :3], roll

    def _correct(self, offset: np.ndarray, offset_velocity: np.ndarray, roll: np.ndarray, contact: np.ndarray) -> None:
        X, noise = self._X, self._noise
        self._roll = roll * contact[:, None]
        loaded, H = self._rows(contact)
        if not len(loaded):
            return
        slip = (roll - offset_velocity)[loaded] - X[V]  # innovation of u_i = v + R (ω × p_i + ṗ_i)
        distrust = self._distrust(loaded, slip)
        for i in loaded[distrust > 1]:
            self._anchor(i, offset[i])
        miss = X[FEET][loaded] - offset[loaded] - X[P]  # innovation of 0 = p + R p_i − c_i
        # The points' velocities measure the same v: their mean, weighted by trust, stands for all.
        trust = 1 / distrust
        weights = trust / trust.sum()
        variance = np.append(distrust * noise.foot_position**2, noise.foot_velocity**2 / trust.sum())
        self._apply(H, np.concatenate([miss, [weights @ slip]]), variance)

    def _rows(self, contact: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the indices of the loaded points ``(n,)`` and their measurement rows ``(n + 1, 2 + n_c)``."""
        key = contact.tobytes()
        if key not in self._rows_of:
            loaded = np.flatnonzero(contact)
            n = len(loaded)
            H = np.zeros((n + 1, 2 + len(contact)))
            H[:n, P] = 1.0
            H[np.arange(n), 2 + loaded] = -1.0
            H[n, V] = 1.0
            self._rows_of[key] = loaded, H
        return self._rows_of[key]

    def _distrust(self, loaded: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Return the factors ``(n,)`` by which loaded points' variances are larger than in a firm stance.

        Large just after the scheduled touchdown, which may not have happened yet, and for points that slip.
        """
        variance = self._P[V, V] + self._noise.foot_velocity**2
        slipping = np.sum(slip**2, axis=1) / (3 * _GATE * variance)
        age = np.maximum(self._time - self._loaded_since[loaded], _INSTANT)
        return np.maximum(1.0, slipping) * np.maximum(1.0, self._noise.touchdown_time / age) ** 2

    def _correct_position(self, position: np.ndarray) -> None:
        H = np.zeros((1, len(self._X)))
        H[0, P] = 1.0
        self._apply(H, (position - self._X[P])[None], np.array([self._noise.localization**2]))

    def _apply(self, H: np.ndarray, innovation: np.ndarray, variance: np.ndarray) -> None:
        """Kalman update with measurement rows H ``(m, 2 + n_c)``, innovations ``(m, 3)`` and variances ``(m,)``."""
        PHt = self._P @ H.T
        S = H @ PHt + np.diag(variance)
        K = np.linalg.solve(S, PHt.T).T
        self._X += K @ innovation
        P_ = self._P - K @ PHt.T
        self._P = (P_ + P_.T) / 2

    def _anchor(self, i: int, offset: np.ndarray) -> None:
        """Take contact point i to rest where forward kinematics has it: c_i = p + R p_i, as uncertain as p and p_i."""
        row = 2 + i
        self._X[row] = self._X[P] + offset
        self._P[row, :] = self._P[P, :]
        self._P[:, row] = self._P[:, P]
        self._P[row, row] = self._P[P, P] + self._noise.foot_position**2

    def _estimate(self, measurement: Measurement) -> Estimate:
        R = rotation.matrix(self._orientation)
        q = np.concatenate([self._X[P], self._orientation, measurement.joint_position])
        v = np.concatenate([R.T @ self._X[V], measurement.angular_velocity, measurement.joint_velocity])
        return Estimate(time=measurement.time, q=q, v=v)


def _drawn(q: np.ndarray, towards: np.ndarray, share: float) -> np.ndarray:
    """Return attitude ``q`` ``(4,)`` drawn to one close by, by ``share`` of the way."""
    mixed = q + share * (np.copysign(1.0, q @ towards) * towards - q)
    return mixed / np.sqrt(mixed @ mixed)
