"""To come to rest over the feet and to stay there: the target that landing, standing and sinking to the ground share."""

from __future__ import annotations

import numpy as np

from aerial_model.kinematics import Configuration, configuration_in
from aerial_model.numerics import rotation
from aerial_model.numerics.components import exp_of, inverse_of, log_of, product_of, quaternion
from aerial_model.numerics.jit import compiled
from aerial_model.robot.robot import BASE_ANGULAR, BASE_ORIENTATION, JOINT_POSITION, JOINT_VELOCITY
from aerial_wbic.behaviours.behaviour import Behaviour, Event, Setting
from aerial_wbic.behaviours.rest_trajectory import REACH, TIME, sampled_trajectory, trajectory_to_rest
from aerial_wbic.behaviours.support import shared_load, support_centre, supported
from aerial_wbic.gains import BodyGains
from aerial_wbic.target import WholeBodyTarget, blank_target, target_in

REST_TOLERANCE = 0.2  # of the height at rest: farther off, something keeps the robot from standing


class RestTarget:
    """Comes to rest, level, over the centre of the support, and stays there.

    All contact points are taken to be on the ground. The trajectory to rest is one of the centre of mass *relative to the
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
        self._trajectory = np.hstack(
            [
                trajectory_to_rest(offset - low, velocity, self._rest, depth_rate),
                trajectory_to_rest(low, np.zeros(3), np.zeros(3), rate),
                trajectory_to_rest(tilt, spin, np.zeros(3), turn_rate),
                trajectory_to_rest(state.q[JOINT_POSITION], state.v[JOINT_VELOCITY], pose, rate),
            ]
        )
        self._begin, self._level = time, level
        self._target = blank_target(len(pose), len(state.contact_positions), gains)
        self._target.contact[:] = True
        self.end = time + TIME / rate  # [s]

    def reached(self, state: Configuration) -> bool:
        """Return whether the centre of mass is where it is to rest, give or take a part of its height."""
        return bool(np.linalg.norm(state.com - support_centre(state) - self._rest) < REST_TOLERANCE * self._rest[2])

    def at(self, time: float, state: Configuration) -> WholeBodyTarget:
        """Return the target at ``time`` [s] of a robot at ``state``; it holds until the next."""
        _sample_rest(self._trajectory, self._level, time - self._begin, state.block, self._target.block)
        return self._target


def rest_target(setting: Setting, time: float, state: Configuration, com_height: float, rate: float) -> RestTarget:
    """Return the target of a robot that begins to come to rest at ``time`` [s], by its controller's gains.

    Args:
        setting: of the robot.
        time: now [s].
        state: of the robot now.
        com_height: of the centre of mass above the ground, at rest [m].
        rate: at which motion dies away [1/s].
    """
    radius = float(np.mean([point.radius for point in setting.robot.contact_points]))
    return RestTarget(
        state,
        time,
        rate=rate,
        com_height=com_height - radius,
        depth=setting.gains.landing_depth,
        turn=setting.gains.landing_turn,
        pose=setting.robot.poses["home"],
        gains=setting.gains.hold,
    )


class Resting(Behaviour):
    """Comes to rest over the feet, and is given up when the trunk tilts too far."""

    _rest: RestTarget | None = None  # None: not begun

    @property
    def rest(self) -> RestTarget:
        """The target that it follows.

        Raises:
            RuntimeError: before it has begun.
        """
        if self._rest is None:
            raise RuntimeError(f"behaviour '{self.name}' has not begun")
        return self._rest

    def observed(self, time: float, state: Configuration) -> Event | None:
        """Return TILTED when the trunk leans beyond recovery."""
        return Event.TILTED if state.R_WB[2, 2] < self._setting.upright_min else None

    def target(self, time: float, state: Configuration) -> WholeBodyTarget:
        """Return what brings the body to rest over the centre of its support."""
        return self.rest.at(time, state)


# Where in a trajectory to rest each part begins: of the centre of mass from the centre of the support, its rise besides, both
# [m], of the attitude as a rotation vector in W from the level one [rad], of the joints [rad].
_OFFSET, _RISE, _TILT, _JOINTS = 0, 3, 6, 9


@compiled
def _sample_rest(
    trajectory: np.ndarray, level: np.ndarray, time: float, state_block: np.ndarray, target_block: np.ndarray
) -> None:
    """Write the target of a robot at a state, ``time`` [s] after the trajectory to rest began."""
    state, target = configuration_in(state_block), target_in(target_block)
    now = sampled_trajectory(trajectory, time)
    omega, angular_acceleration = np.zeros(3), np.empty(3)
    _write_com(now, state, target)
    _write_attitude(now, level, state, target, omega, angular_acceleration)
    _write_angular_momentum(state, target, omega, angular_acceleration)
    for j in range(len(target.joint_position)):
        target.joint_position[j] = now[0, _JOINTS + j]
        target.joint_velocity[j] = now[1, _JOINTS + j]
        target.joint_acceleration[j] = now[2, _JOINTS + j]


@compiled
def _write_com(now: np.ndarray, state: Configuration, target: WholeBodyTarget) -> None:
    """Write the course of the centre of mass, as far as the support can give it, and the forces that go with it."""
    body, position = target.body, target.body.gains.position
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
    for k in range(3):
        body.com_acceleration[k] = total[k] - feedback[k]


@compiled
def _write_attitude(
    now: np.ndarray,
    level: np.ndarray,
    state: Configuration,
    target: WholeBodyTarget,
    omega: np.ndarray,
    angular_acceleration: np.ndarray,
) -> None:
    """Write the course of the attitude; and ω [rad/s] and, with the base task's feedback, ω̇ ``(3,)`` [rad/s²] in W."""
    body, attitude = target.body, target.body.gains.attitude
    orientation = product_of(exp_of((now[0, _TILT], now[0, _TILT + 1], now[0, _TILT + 2])), quaternion(level))
    turn = log_of(product_of(orientation, inverse_of(quaternion(state.q[BASE_ORIENTATION]))))
    for k in range(3):
        body.angular_velocity[k], body.angular_acceleration[k] = now[1, _TILT + k], now[2, _TILT + k]
        for i in range(3):
            omega[k] += state.R_WB[k, i] * state.v[BASE_ANGULAR.start + i]
        angular_acceleration[k] = body.angular_acceleration[k]
        feedback = attitude.damping * (body.angular_velocity[k] - omega[k]) + attitude.stiffness * turn[k]
        angular_acceleration[k] += feedback
    for k in range(4):
        body.orientation[k] = orientation[k]


@compiled
def _write_angular_momentum(
    state: Configuration, target: WholeBodyTarget, omega: np.ndarray, angular_acceleration: np.ndarray
) -> None:
    """Write the angular momentum of a robot that turns as one: only that of joints moving beside the base is to go away."""
    for i in range(3):
        target.angular_momentum[i] = target.angular_momentum_rate[i] = 0.0
        for j in range(3):
            inertia = 0.0  # with joints locked, about W's axes
            for k in range(3):
                inertia += state.A_G[i, BASE_ANGULAR.start + k] * state.R_WB[j, k]
            target.angular_momentum[i] += inertia * omega[j]
            target.angular_momentum_rate[i] += inertia * angular_acceleration[j]
