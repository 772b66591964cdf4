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
assumed about the height of the ground. A loaded point that moves against the filter's estimate (not yet down, slipping) is
believed less in proportion: its noise grows with the square of the disagreement, and it is anchored anew. So is, for a
moment, every point that the schedule has just put on the ground.
"""

from __future__ import annotations

import numpy as np

from aerial_model.kinematics import Configuration, Kinematics, Workspace, carry, configuration_in, fill
from aerial_model.numerics.components import ZERO, exp_of, matrix_of, product_of, quaternion, sum_of, vector
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.linalg import cholesky, cholesky_solve
from aerial_model.robot.robot import (
    BASE_ANGULAR,
    BASE_LINEAR,
    BASE_ORIENTATION,
    BASE_POSITION,
    GRAVITY,
    JOINT_POSITION,
    JOINT_VELOCITY,
    Robot,
)
from aerial_model.values.estimate import Estimate
from aerial_model.values.measurement import Measurement
from aerial_wbic.estimation.filter_state import FEET, FilterState, P, V, filter_state_in, initial_filter_state
from aerial_wbic.gains import EstimatorNoise
from aerial_wbic.stopwatch import Part, Stopwatch

_INSTANT = 1e-3  # [s] less than a period
_GATE = 4.0  # squared disagreement, in variances, from which a point is believed less


class Estimator:
    """Kalman filter over one robot's base and contact points.

    Args:
        robot: the robot.
        noise: what is assumed about the sensors.
        stopwatch: by which the kinematics are timed.
    """

    def __init__(self, robot: Robot, noise: EstimatorNoise, stopwatch: Stopwatch | None = None) -> None:
        self._stopwatch = stopwatch or Stopwatch()
        self.kinematics = Kinematics(robot)
        self.state = self.kinematics.blank()  # the robot at the estimate, until the next; zeros before the first
        self._noise = noise
        self._radius = np.array([point.radius for point in robot.contact_points])  # (n_c,) [m]
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next measurement puts the support's centre at the origin of W, unless it is localized."""
        self._time: float | None = None

    def update(self, measurement: Measurement, contact: np.ndarray) -> Estimate:
        """Return the estimate at the measurement's time.

        Args:
            measurement: of the robot.
            contact: points the schedule has on the ground ``(n_c,)`` bool.
        """
        first, before = self._time is None, self._time
        if before is None:
            before = measurement.time
            self._filter = initial_filter_state(
                measurement.orientation, measurement.angular_velocity, len(self._radius)
            )
        state = self.state
        _predict(
            self._filter.block,
            state.block,
            measurement.time - before,
            measurement.angular_velocity,
            measurement.linear_acceleration,
            measurement.orientation,
            measurement.joint_position,
            measurement.joint_velocity,
            self._noise,
        )
        self._stopwatch.lap(Part.ESTIMATE)
        workspace = self.kinematics.computed(state.q, state.v)
        self._stopwatch.lap(Part.KINEMATICS)
        if first:
            self._begin(workspace.contacts, measurement.localization)
        self._time = measurement.time
        if measurement.localization is not None:
            _correct_position(self._filter, measurement.localization, self._noise)
        _correct(self._filter.block, state.block, workspace, self._radius, contact, measurement.time, self._noise)
        return Estimate(
            time=measurement.time,
            q=state.q.copy(),
            v=state.v.copy(),
            position_variance=float(self._filter.P[P, P]),
            velocity_variance=float(self._filter.P[V, V]),
        )

    def _begin(self, offset: np.ndarray, localization: np.ndarray | None) -> None:
        """Take the contact points, ``offset`` ``(n_c, 3)`` from the base, to rest on level ground."""
        filter_state = self._filter
        filter_state.X[P] = [0.0, 0.0, self._radius.mean()] - offset.mean(axis=0)
        # The attitude's error moves all offsets alike: no mean over feet.
        filter_state.P[P, P] = self._noise.foot_position**2
        if localization is not None:
            filter_state.X[P] = localization
            filter_state.P[P, P] = self._noise.localization**2
        filter_state.P[V, V] = self._noise.foot_velocity**2
        for i in range(len(offset)):
            _anchor(filter_state, i, offset[i], self._noise)


@compiled
def _predict(
    filter_block: np.ndarray,
    state_block: np.ndarray,
    dt: float,
    angular_velocity: np.ndarray,
    specific_force: np.ndarray,
    orientation: np.ndarray,
    joint_position: np.ndarray,
    joint_velocity: np.ndarray,
    noise: EstimatorNoise,
) -> None:
    """Carry the filter on by ``dt`` [s] with what the sensors say at its end; ``orientation`` is the inertial unit's.

    Write into the robot's q and v what the sensors and the estimated attitude say, the base at the origin and linearly at
    rest.
    """
    filter_state, state = filter_state_in(filter_block), configuration_in(state_block)
    q, v = state.q, state.v
    X, cov = filter_state.X, filter_state.P
    half_turn = exp_of(
        sum_of(ZERO, sum_of(vector(filter_state.angular_velocity), vector(angular_velocity), 1.0), dt / 4)
    )
    filter_state.angular_velocity[:] = angular_velocity
    midway = product_of(quaternion(filter_state.orientation), half_turn)
    share = min(dt / noise.attitude_time, 1.0)
    _draw(filter_state.orientation, product_of(midway, half_turn), quaternion(orientation), share)
    # The accelerometer reports the mean over the interval: it acts at the attitude half-way.
    R = matrix_of(midway)
    for axis in range(3):
        x, y, z = R[axis]
        a = x * specific_force[0] + y * specific_force[1] + z * specific_force[2]
        if axis == 2:
            a -= GRAVITY
        X[P, axis] += X[V, axis] * dt + a * dt**2 / 2
        X[V, axis] += a * dt
        for i in range(len(filter_state.roll)):
            X[FEET + i, axis] += filter_state.roll[i, axis] * dt
    for k in range(len(X)):
        cov[P, k] += dt * cov[V, k]  # F P Fᵀ
    for k in range(len(X)):
        cov[k, P] += dt * cov[k, V]
    push = noise.acceleration**2 * dt**2
    cov[P, P] += push * dt**2 / 4
    cov[P, V] += push * dt / 2
    cov[V, P] += push * dt / 2
    cov[V, V] += push
    for i in range(FEET, len(X)):
        cov[i, i] += noise.foot_drift**2 * dt
    q[BASE_POSITION], q[BASE_ORIENTATION], q[JOINT_POSITION] = 0.0, filter_state.orientation, joint_position
    v[BASE_LINEAR], v[BASE_ANGULAR], v[JOINT_VELOCITY] = 0.0, angular_velocity, joint_velocity


@compiled
def _draw(orientation: np.ndarray, attitude: tuple[float, ...], towards: tuple[float, ...], share: float) -> None:
    """Write an attitude drawn to one close by, by ``share`` of the way; both by the components of quaternions."""
    along = attitude[0] * towards[0] + attitude[1] * towards[1] + attitude[2] * towards[2] + attitude[3] * towards[3]
    sign, squared = np.copysign(1.0, along), 0.0
    for i in range(4):
        orientation[i] = attitude[i] + share * (sign * towards[i] - attitude[i])
        squared += orientation[i] ** 2
    for i in range(4):
        orientation[i] /= np.sqrt(squared)


@compiled
def _correct(
    filter_block: np.ndarray,
    state_block: np.ndarray,
    workspace: Workspace,
    radius: np.ndarray,
    contact: np.ndarray,
    time: float,
    noise: EstimatorNoise,
) -> None:
    """Fill in the robot as seen from its base, let its loaded points measure; then move it to where it is estimated to be."""
    filter_state, state = filter_state_in(filter_block), configuration_in(state_block)
    fill(state, workspace)
    _correct_by_legs(filter_state, state, radius, contact, time, noise)
    carry(state, filter_state.X[P], filter_state.X[V])


@compiled
def _correct_by_legs(
    filter_state: FilterState,
    state: Configuration,
    radius: np.ndarray,
    contact: np.ndarray,
    time: float,
    noise: EstimatorNoise,
) -> None:
    """Kalman update by forward kinematics: R p_i are the contact positions, R (ω × p_i + ṗ_i) the contact velocities."""
    X = filter_state.X
    loaded = np.flatnonzero(contact)
    n = len(loaded)
    filter_state.roll[:] = 0.0
    filter_state.loaded_since[~contact] = time
    if n == 0:
        return
    slip = np.empty((n, 3))  # innovation of u_i = v + R (ω × p_i + ṗ_i)
    variance = np.empty(n + 1)
    for row, i in enumerate(loaded):
        # A sphere that rolls without slip on level ground has its centre moving at ω × (0, 0, radius).
        filter_state.roll[i, 0] = state.omega_contacts[i, 1] * radius[i]
        filter_state.roll[i, 1] = -state.omega_contacts[i, 0] * radius[i]
        for axis in range(3):
            slip[row, axis] = filter_state.roll[i, axis] - X[V, axis]
            for k in range(len(state.v)):
                slip[row, axis] -= state.J_contacts[i, axis, k] * state.v[k]
        distrust = _distrust(filter_state, int(i), slip[row], time, noise)
        if distrust > 1.0:
            _anchor(filter_state, int(i), state.contact_positions[i], noise)
        variance[row] = distrust
    # The points' velocities measure the same v: their mean, weighted by trust, stands for all.
    H, innovation, trust = np.zeros((n + 1, len(X))), np.zeros((n + 1, 3)), 0.0
    for row, i in enumerate(loaded):
        H[row, P], H[row, FEET + i] = 1.0, -1.0
        trust += 1.0 / variance[row]
        for axis in range(3):
            innovation[row, axis] = (
                X[FEET + i, axis] - state.contact_positions[i, axis] - X[P, axis]
            )  # 0 = p + R p_i − c_i
            innovation[n, axis] += slip[row, axis] / variance[row]
        variance[row] *= noise.foot_position**2
    H[n, V] = 1.0
    innovation[n] /= trust
    speed = X[V, 0] ** 2 + X[V, 1] ** 2 + X[V, 2] ** 2
    in_motion = noise.foot_velocity_share**2 * speed  # common to all points: no mean over them
    variance[n] = noise.foot_velocity**2 / trust + in_motion
    _apply(filter_state, H, innovation, variance)


@compiled
def _distrust(filter_state: FilterState, i: int, slip: np.ndarray, time: float, noise: EstimatorNoise) -> float:
    """Return the factor by which the variance of loaded point i is larger than in a firm stance.

    Large just after the scheduled touchdown, which may not have happened yet, and for a point that slips.
    """
    variance = filter_state.P[V, V] + noise.foot_velocity**2
    slipping = (slip[0] ** 2 + slip[1] ** 2 + slip[2] ** 2) / (3 * _GATE * variance)
    age = max(time - filter_state.loaded_since[i], _INSTANT)
    return float(max(1.0, slipping) * max(1.0, noise.touchdown_time / age) ** 2)


@compiled
def _correct_position(filter_state: FilterState, position: np.ndarray, noise: EstimatorNoise) -> None:
    H, innovation = np.zeros((1, len(filter_state.X))), np.empty((1, 3))
    H[0, P] = 1.0
    innovation[0] = position - filter_state.X[P]
    _apply(filter_state, H, innovation, np.array([noise.localization**2]))


@compiled
def _apply(filter_state: FilterState, H: np.ndarray, innovation: np.ndarray, variance: np.ndarray) -> None:
    """Kalman update with measurement rows H ``(m, 2 + n_c)``, innovations ``(m, 3)`` and variances ``(m,)``."""
    X, cov, (m, n) = filter_state.X, filter_state.P, H.shape
    HP, S = np.zeros((m, n)), np.zeros((m, m))
    for i in range(m):
        for k in range(n):
            factor = H[i, k]
            if factor != 0.0:
                for c in range(n):
                    HP[i, c] += factor * cov[k, c]
    for j in range(m):
        for k in range(n):
            factor = H[j, k]
            if factor != 0.0:
                for i in range(m):
                    S[i, j] += HP[i, k] * factor
        S[j, j] += variance[j]
    cholesky(S, S)
    gain = HP.copy()
    cholesky_solve(S, gain)  # Kᵀ
    for i in range(m):
        for row in range(n):
            for axis in range(3):
                X[row, axis] += gain[i, row] * innovation[i, axis]
            for c in range(row + 1):
                cov[row, c] -= gain[i, row] * HP[i, c]
    for row in range(n):
        for c in range(row):
            cov[c, row] = cov[row, c]


@compiled
def _anchor(filter_state: FilterState, i: int, offset: np.ndarray, noise: EstimatorNoise) -> None:
    """Take contact point i to rest where forward kinematics has it: c_i = p + R p_i, as uncertain as p and p_i."""
    row = FEET + i
    filter_state.X[row] = filter_state.X[P] + offset
    filter_state.P[row, :] = filter_state.P[P, :]
    filter_state.P[:, row] = filter_state.P[:, P]
    filter_state.P[row, row] = filter_state.P[P, P] + noise.foot_position**2
