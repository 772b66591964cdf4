"""What the robot should do now: a plan's sample made whole, or rest over the centre of its support.

Both give the same thing, so that one hierarchy serves take-off, flight, landing and standing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.kinematics import Configuration, configuration_in
from aerial_model.numerics import rotation
from aerial_model.numerics.components import exp_of, inverse_of, log_of, matrix_of, product_of, quaternion, vector
from aerial_model.numerics.jit import compiled
from aerial_model.numerics.layout import cut, cut_flags, cut_rows, flags_size
from aerial_model.robot.robot import BASE_ANGULAR, BASE_ORIENTATION, JOINT_POSITION, JOINT_VELOCITY
from aerial_model.values.plan import Track, sampled
from aerial_wbic.behaviours.settling import REACH, TIME, settled, settling
from aerial_wbic.behaviours.support import shared_load, support_centre, supported
from aerial_wbic.gains import BodyGains, Feedback

REST_TOLERANCE = 0.2  # of the height at rest: farther off, something keeps the robot from standing


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
    """Everything the hierarchy and the optimization follow in one tick; all arrays lie in one block."""

    body: BodyTarget
    joint_position: np.ndarray  # (n,) [rad]
    joint_velocity: np.ndarray  # (n,) [rad/s]
    joint_acceleration: np.ndarray  # (n,) [rad/s²]
    angular_momentum: np.ndarray  # (3,) [kg·m²/s]
    angular_momentum_rate: np.ndarray  # (3,) [N·m]
    force: np.ndarray  # f_cmd (n_c, 3) in W [N]
    contact: np.ndarray  # (n_c,) bool
    block: np.ndarray  # what all these arrays lie in


_N, _N_C, _GAINS, _HEADER = 0, 1, 2, 6  # where a block says how many joints and points there are, and the body's gains


def blank_target(n: int, n_c: int, gains: BodyGains) -> WholeBodyTarget:
    """Return the memory of a target for n joints and n_c contact points, none of which carries load."""
    block = np.zeros(_HEADER + 19 + 3 * n + 6 + 3 * n_c + flags_size(n_c))
    block[:_HEADER] = n, n_c, *gains.position, *gains.attitude
    return target_in(block)


@compiled
def target_in(block: np.ndarray) -> WholeBodyTarget:
    """Return the target that lies in a block."""
    n, n_c = int(block[_N]), int(block[_N_C])
    com, at = cut(block, _HEADER, 3)
    com_velocity, at = cut(block, at, 3)
    com_acceleration, at = cut(block, at, 3)
    orientation, at = cut(block, at, 4)
    angular_velocity, at = cut(block, at, 3)
    angular_acceleration, at = cut(block, at, 3)
    joint_position, at = cut(block, at, n)
    joint_velocity, at = cut(block, at, n)
    joint_acceleration, at = cut(block, at, n)
    angular_momentum, at = cut(block, at, 3)
    angular_momentum_rate, at = cut(block, at, 3)
    force, at = cut_rows(block, at, n_c, 3)
    contact, at = cut_flags(block, at, n_c)
    gains = BodyGains(
        Feedback(block[_GAINS], block[_GAINS + 1]),
        Feedback(block[_GAINS + 2], block[_GAINS + 3]),
    )
    body = BodyTarget(com, com_velocity, com_acceleration, orientation, angular_velocity, angular_acceleration, gains)
    return WholeBodyTarget(
        body,
        joint_position,
        joint_velocity,
        joint_acceleration,
        angular_momentum,
        angular_momentum_rate,
        force,
        contact,
        block,
    )


class PostureTarget(NamedTuple):
    """Joint positions, for a robot that lies and has nothing to balance."""

    joint_position: np.ndarray  # (n,) [rad]
    joint_velocity: np.ndarray  # (n,) [rad/s]


class Following:
    """Follows a plan.

    Args:
        track: of the plan, in W.
        gains: of the base task.
    """

    def __init__(self, track: Track, gains: BodyGains) -> None:
        self._track = track
        self._target = blank_target(track.n_joints, track.contact.shape[1], gains)

    def at(self, time: float, *, waiting: bool = False) -> WholeBodyTarget:
        """Return the target at ``time`` [s] since the plan began; it holds until the next.

        Args:
            time: since the plan began [s].
            waiting: for a contact, in the landing pose: the joints are at rest.
        """
        _followed(self._track, time, waiting, self._target.block)
        return self._target


@compiled
def _followed(track: Track, time: float, waiting: bool, block: np.ndarray) -> None:
    target = target_in(block)
    sample, body = sampled(track, time), target.body
    R = matrix_of(quaternion(sample.q[BASE_ORIENTATION]))
    omega, omega_rate = vector(sample.v[BASE_ANGULAR]), vector(sample.vdot[BASE_ANGULAR])
    for i in range(3):
        body.com[i], body.com_velocity[i] = sample.com[i], sample.com_velocity[i]
        body.com_acceleration[i] = sample.com_acceleration[i]
        body.angular_velocity[i] = R[i][0] * omega[0] + R[i][1] * omega[1] + R[i][2] * omega[2]
        body.angular_acceleration[i] = R[i][0] * omega_rate[0] + R[i][1] * omega_rate[1] + R[i][2] * omega_rate[2]
    body.orientation[:] = sample.q[BASE_ORIENTATION]
    target.joint_position[:] = sample.q[JOINT_POSITION]
    moving = 0.0 if waiting else 1.0
    target.joint_velocity[:] = moving * sample.v[JOINT_VELOCITY]
    target.joint_acceleration[:] = moving * sample.vdot[JOINT_VELOCITY]
    target.angular_momentum[:] = sample.angular_momentum
    target.angular_momentum_rate[:] = sample.angular_momentum_rate
    target.force[:] = sample.force
    target.contact[:] = sample.contact


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
        depth_rate = max(rate, REACH * abs(velocity[2]) / depth)
        turn_rate = max(rate, REACH * float(np.linalg.norm(spin)) / turn)
        self._ways = np.hstack(
            [
                settling(offset - low, velocity, self._rest, depth_rate),
                settling(low, np.zeros(3), np.zeros(3), rate),
                settling(tilt, spin, np.zeros(3), turn_rate),
                settling(state.q[JOINT_POSITION], state.v[JOINT_VELOCITY], pose, rate),
            ]
        )
        self._begin, self._level = time, level
        self._target = blank_target(len(pose), len(state.contact_positions), gains)
        self._target.contact[:] = True
        self.end = time + TIME / rate

    def reached(self, state: Configuration) -> bool:
        """Return whether the centre of mass is where it is to rest, give or take a part of its height."""
        return bool(np.linalg.norm(state.com - support_centre(state) - self._rest) < REST_TOLERANCE * self._rest[2])

    def at(self, time: float, state: Configuration) -> WholeBodyTarget:
        """Return the target at ``time`` [s] of a robot at ``state``; it holds until the next."""
        _held(self._ways, self._level, time - self._begin, state.block, self._target.block)
        return self._target


# Where in a hold's ways to rest each begins: of the centre of mass from the centre of the support, its rise besides, both [m],
# of the attitude as a rotation vector in W from the level one [rad], of the joints [rad].
_OFFSET, _RISE, _TILT, _JOINTS = 0, 3, 6, 9


@compiled
def _held(ways: np.ndarray, level: np.ndarray, time: float, state_block: np.ndarray, target_block: np.ndarray) -> None:
    state, target = configuration_in(state_block), target_in(target_block)
    body, now = target.body, settled(ways, time)
    position, attitude = body.gains
    centre, acceleration, feedback = support_centre(state), np.empty(3), np.empty(3)
    for k in range(3):
        body.com[k] = centre[k] + now[0, _OFFSET + k] + now[0, _RISE + k]
        body.com_velocity[k] = now[1, _OFFSET + k] + now[1, _RISE + k]
        # The base task adds its feedback to this acceleration; the sum is what the support can give.
        feedback[k] = position.stiffness * (body.com[k] - state.com[k])
        feedback[k] += position.damping * (body.com_velocity[k] - state.com_velocity[k])
        acceleration[k] = now[2, _OFFSET + k] + now[2, _RISE + k] + feedback[k]
    total = supported(state, acceleration)
    shared_load(state, total, target.force)
    orientation = product_of(exp_of((now[0, _TILT], now[0, _TILT + 1], now[0, _TILT + 2])), quaternion(level))
    turn = log_of(product_of(orientation, inverse_of(quaternion(state.q[BASE_ORIENTATION]))))
    omega, turning = np.zeros(3), np.empty(3)
    for k in range(3):
        body.com_acceleration[k] = total[k] - feedback[k]
        body.angular_velocity[k], body.angular_acceleration[k] = now[1, _TILT + k], now[2, _TILT + k]
        for i in range(3):
            omega[k] += state.R_WB[k, i] * state.v[BASE_ANGULAR.start + i]
        turning[k] = body.angular_acceleration[k]
        turning[k] += attitude.damping * (body.angular_velocity[k] - omega[k]) + attitude.stiffness * turn[k]
    for k in range(4):
        body.orientation[k] = orientation[k]
    # The robot turns as one: of the angular momentum only that of joints moving beside the base is to go away.
    for i in range(3):
        target.angular_momentum[i] = target.angular_momentum_rate[i] = 0.0
        for j in range(3):
            inertia = 0.0  # with joints locked, about W's axes
            for k in range(3):
                inertia += state.A_G[i, BASE_ANGULAR.start + k] * state.R_WB[j, k]
            target.angular_momentum[i] += inertia * omega[j]
            target.angular_momentum_rate[i] += inertia * turning[j]
    for j in range(len(target.joint_position)):
        target.joint_position[j] = now[0, _JOINTS + j]
        target.joint_velocity[j] = now[1, _JOINTS + j]
        target.joint_acceleration[j] = now[2, _JOINTS + j]


class Fold:
    """Brings the legs from where they are to a pose, as fast as the poles of ``settling`` let it.

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
