"""What the robot should do now: a plan's sample made whole, or rest over the centre of its support.

Both give the same thing, so that one hierarchy serves take-off, flight, landing and standing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model import plan as plans
from aerial_model import rotation
from aerial_model.compiled import (
    cholesky,
    cholesky_solve,
    compiled,
    exp_of,
    inverse_of,
    log_of,
    product_of,
    quaternion,
    vector,
)
from aerial_model.kinematics import Configuration
from aerial_model.robot import BASE_ANGULAR, BASE_ORIENTATION, JOINT_POSITION, JOINT_VELOCITY
from aerial_wbic.gains import BodyGains
from aerial_wbic.settling import REACH, TIME, Settling, settled, settling

GRAVITY = 9.81  # [m/s²]
_SUPPORT_SHARE = 0.8  # of the support's extent that the resultant force may use
_VERTICAL = 1e-6  # horizontal part of the base's x axis below which it has no heading
REST_TOLERANCE = 0.2  # of the height at rest: farther off, something keeps the robot from standing
_WRENCH_REGULARIZATION = 1e-6  # [m²] keeps the share of the load defined when the support is a line or a point


class BodyTarget(NamedTuple):
    """Centre of mass and base attitude, in W, with the gains that hold them there."""

    com: np.ndarray  # (3,) [m]
    com_velocity: np.ndarray  # (3,) [m/s]
    com_acceleration: np.ndarray  # (3,) [m/s²]
    orientation: np.ndarray  # (4,) quaternion xyzw
    angular_velocity: np.ndarray  # (3,) [rad/s]
    angular_acceleration: np.ndarray  # (3,) [rad/s²]
    gains: BodyGains


class WholeBodyTarget(NamedTuple):
    """Everything the hierarchy and the optimization follow in one tick."""

    body: BodyTarget
    joint_position: np.ndarray  # (n,) [rad]
    joint_velocity: np.ndarray  # (n,) [rad/s]
    joint_acceleration: np.ndarray  # (n,) [rad/s²]
    angular_momentum: np.ndarray  # (3,) [kg·m²/s]
    angular_momentum_rate: np.ndarray  # (3,) [N·m]
    force: np.ndarray  # f_cmd (n_c, 3) in W [N]
    contact: np.ndarray  # (n_c,) bool


class PostureTarget(NamedTuple):
    """Joint positions, for a robot that lies and has nothing to balance."""

    joint_position: np.ndarray  # (n,) [rad]
    joint_velocity: np.ndarray  # (n,) [rad/s]


def from_plan(sample: plans.Target, gains: BodyGains) -> WholeBodyTarget:
    """Return the target that follows a plan's sample, expressed in W."""
    R = rotation.matrix(sample.q[BASE_ORIENTATION])
    body = BodyTarget(
        com=sample.com,
        com_velocity=sample.com_velocity,
        com_acceleration=sample.com_acceleration,
        orientation=sample.q[BASE_ORIENTATION],
        angular_velocity=R @ sample.v[BASE_ANGULAR],
        angular_acceleration=R @ sample.vdot[BASE_ANGULAR],
        gains=gains,
    )
    return WholeBodyTarget(
        body=body,
        joint_position=sample.q[JOINT_POSITION],
        joint_velocity=sample.v[JOINT_VELOCITY],
        joint_acceleration=sample.vdot[JOINT_VELOCITY],
        angular_momentum=sample.angular_momentum,
        angular_momentum_rate=sample.angular_momentum_rate,
        force=sample.force.copy(),  # whoever made the plan: compiled code takes writable arrays only
        contact=sample.contact.copy(),
    )


def waiting(target: WholeBodyTarget) -> WholeBodyTarget:
    """Return a target with the joints at rest where it has them: for who waits in the landing pose for a contact."""
    still = np.zeros_like(target.joint_velocity)
    return target._replace(joint_velocity=still, joint_acceleration=still.copy())


class Hold:
    """Comes to rest, level, over the centre of the support, and stays there.

    All contact points are taken to be on the ground. The way to rest is one of the centre of mass *relative to the
    centre of its support* and of the attitude, from how the robot moves at the beginning: neither an early nor a late
    touchdown makes the error jump. Joints that are free to do so go to a pose. A fall is caught within a given
    depth below the height it comes at, and forward speed as fast: only while the feet bear that load do friction and the
    length of the support let them. To the height to stand at the robot rises at its own rate, whatever the fall: the
    faster it rose, the less the feet would bear afterwards. A rotation is caught within a given angle.

    Args:
        state: of the robot at the beginning.
        time: of the beginning [s].
        rate: at which motion dies away [1/s]; faster where the depth and the turn ask for it.
        com_height: of the centre of mass above the centre of the contact spheres, at rest [m].
        depth: to which a fall is caught [m].
        turn: to which a rotation is caught [rad].
        pose: joint positions ``(n,)`` to go to, as far as contacts and body leave them free [rad].
        gains: of the base task.
    """

    def __init__(
        self,
        state: Configuration,
        time: float,
        *,
        rate: float,
        com_height: float,
        depth: float,
        turn: float,
        pose: np.ndarray,
        gains: BodyGains,
    ) -> None:
        velocity = state.com_velocity
        offset = state.com - support_centre(state)
        self._rest = np.array([0.0, 0.0, com_height])
        # The attitude as a rotation vector from the level attitude of the present heading.
        level = rotation.about_z(rotation.heading(state.base_orientation))
        tilt = rotation.log(rotation.multiply(state.base_orientation, rotation.conjugate(level)))
        spin = state.R_WB @ state.v[BASE_ANGULAR]
        low = np.array([0.0, 0.0, offset[2] - com_height])  # by which it is below where it is to stand
        self._course = _Course(
            begin=time,
            offset=settling(offset - low, velocity, self._rest, max(rate, REACH * abs(velocity[2]) / depth)),
            rise=settling(low, np.zeros(3), np.zeros(3), rate),
            tilt=settling(tilt, spin, np.zeros(3), max(rate, REACH * float(np.linalg.norm(spin)) / turn)),
            level=level,
            joints=settling(state.q[JOINT_POSITION], state.v[JOINT_VELOCITY], pose, rate),
        )
        self._target = _resting(len(state.v) - JOINT_VELOCITY.start, len(state.contact_positions), gains)
        self.end = time + TIME / rate

    def reached(self, state: Configuration) -> bool:
        """Return whether the centre of mass is where it is to rest, give or take a part of its height."""
        return bool(np.linalg.norm(state.com - support_centre(state) - self._rest) < REST_TOLERANCE * self._rest[2])

    def at(self, time: float, state: Configuration) -> WholeBodyTarget:
        """Return the target at ``time`` [s] of a robot at ``state``; it holds until the next."""
        _held(self._course, time, state, self._target)
        return self._target


class _Course(NamedTuple):
    """The way to rest: of the centre of mass from the centre of the support, of the attitude from ``level``, of the joints."""

    begin: float  # [s]
    offset: Settling  # [m]
    rise: Settling  # to the height to stand at, besides [m]
    tilt: Settling  # rotation vector in W [rad]
    level: np.ndarray  # (4,)
    joints: Settling  # [rad]


def _resting(n: int, n_c: int, gains: BodyGains) -> WholeBodyTarget:
    """Return the memory of a target with every contact point on the ground and n joints that do not move."""
    body = BodyTarget(*(np.zeros(size) for size in (3, 3, 3, 4, 3, 3)), gains)
    joints = [np.zeros(n) for _ in range(3)]
    return WholeBodyTarget(body, *joints, np.zeros(3), np.zeros(3), np.zeros((n_c, 3)), np.ones(n_c, dtype=bool))


@compiled
def _held(course: _Course, time: float, state: Configuration, target: WholeBodyTarget) -> None:
    body = target.body
    position, attitude = body.gains
    offset, velocity, acceleration = settled(course.offset, time - course.begin)
    rise, rise_velocity, rise_acceleration = settled(course.rise, time - course.begin)
    body.com[:] = support_centre(state) + offset + rise
    body.com_velocity[:] = velocity + rise_velocity
    acceleration += rise_acceleration
    # The base task adds its feedback to this acceleration; the sum is what the support can give.
    feedback = position.stiffness * (body.com - state.com) + position.damping * (body.com_velocity - state.com_velocity)
    total = supported(state, acceleration + feedback)
    body.com_acceleration[:] = total - feedback
    tilt, body.angular_velocity[:], body.angular_acceleration[:] = settled(course.tilt, time - course.begin)
    orientation = product_of(exp_of(vector(tilt)), quaternion(course.level))
    body.orientation[:] = orientation
    # The robot turns as one: of the angular momentum only that of joints moving beside the base is to go away.
    inertia = np.ascontiguousarray(state.A_G[:3, BASE_ANGULAR]) @ state.R_WB.T  # with joints locked, about W's axes
    omega = state.R_WB @ state.v[BASE_ANGULAR]
    turn = np.array(log_of(product_of(orientation, inverse_of(quaternion(state.q[BASE_ORIENTATION])))))
    turning = attitude.damping * (body.angular_velocity - omega) + attitude.stiffness * turn
    target.angular_momentum[:] = inertia @ omega
    target.angular_momentum_rate[:] = inertia @ (body.angular_acceleration + turning)
    target.joint_position[:], target.joint_velocity[:], target.joint_acceleration[:] = settled(
        course.joints, time - course.begin
    )
    target.force[:] = shared_load(state, total)


class Fold:
    """Brings the legs from where they are to a pose, as fast as the poles of ``Settling`` let it.

    Args:
        state: of the robot at the beginning.
        time: of the beginning [s].
        rate: at which the distance dies away [1/s].
        pose: joint positions ``(n,)`` [rad].
    """

    def __init__(self, state: Configuration, time: float, *, rate: float, pose: np.ndarray) -> None:
        self._begin = time
        self._joints = settling(state.q[JOINT_POSITION], state.v[JOINT_VELOCITY], pose, rate)
        self.end = time + TIME / rate

    def at(self, time: float, state: Configuration) -> PostureTarget:
        """Return the target at ``time`` [s]; where the robot is does not matter."""
        position, velocity, _ = settled(self._joints, time - self._begin)
        return PostureTarget(joint_position=position, joint_velocity=velocity)


@compiled
def support_centre(state: Configuration) -> np.ndarray:
    """Return the mean of the contact spheres' centres ``(3,)`` [m] in W."""
    return state.contact_positions.sum(axis=0) / len(state.contact_positions)


@compiled
def supported(state: Configuration, acceleration: np.ndarray) -> np.ndarray:
    """Return the acceleration of the centre of mass nearest to one ``(3,)`` that the support gives without turning the body.

    The line of the force through the centre of mass meets the ground within a part of the rectangle, along the heading,
    that the contact points span; the rest is for moments. What is asked for beyond that would roll the feet over.
    """
    F = acceleration[2] + GRAVITY
    arms = state.contact_positions - state.com  # (n_c, 3)
    height = -arms[:, 2].mean()
    if F <= 0 or height <= 0:
        return acceleration
    ahead = state.R_WB[:2, 0] / max(np.hypot(state.R_WB[0, 0], state.R_WB[1, 0]), _VERTICAL)
    result = acceleration.copy()
    for axis in range(2):
        direction = ahead if axis == 0 else np.array([-ahead[1], ahead[0]])
        reach = np.ascontiguousarray(arms[:, :2]) @ direction
        middle, half = (reach.max() + reach.min()) / 2, _SUPPORT_SHARE * (reach.max() - reach.min()) / 2
        wanted = acceleration[:2] @ direction
        meets = -wanted * height / F  # from under the centre of mass, against the acceleration
        allowed = min(max(meets, middle - half), middle + half)
        result[:2] += (-allowed * F / height - wanted) * direction
    return result


@compiled
def shared_load(state: Configuration, com_acceleration: np.ndarray) -> np.ndarray:
    """Return forces ``(n_c, 3)`` [N] in W that accelerate the centre of mass and do not turn the body.

    Every point takes a share w_i of the same force F = m (r̈ − g): Σ w_i = 1, and Σ w_i c_i lies where F through the
    centre of mass meets the height of the support. Of these shares it is the most even one; none is negative.
    """
    F = state.mass * com_acceleration
    F[2] += state.mass * GRAVITY
    arms = state.contact_positions - state.com  # (n_c, 3)
    A = np.ones((3, len(arms)))
    A[1:] = arms[:, :2].T
    b = np.zeros((3, 1))
    b[0] = 1.0
    if F[2] > 0:
        b[1:, 0] = arms[:, 2].mean() * F[:2] / F[2]
    L = np.empty((3, 3))
    cholesky(A @ A.T + _WRENCH_REGULARIZATION * np.eye(3), L)
    cholesky_solve(L, b)
    w = A.T @ b  # (n_c, 1)
    return np.maximum(w, 0.0) * F
