"""What the controller's tests share: the robot, states of it, and a hop on the spot made without the planner."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.kinematics import Kinematics, factorize
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, BASE_POSITION, JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_model.values.plan import Plan
from aerial_wbic.gains import ControllerGains
from aerial_wbic.target import blank_target
from aerial_wbic.tasks.hierarchy import add_by_null_space, least_energy_solution, no_tasks
from aerial_wbic.tasks.tasks import command

GRAVITY = 9.81  # [m/s²]
DT = 0.01  # between knots [s]
PUSH_TIME = 0.4  # from rest to take-off [s]
TAKE_OFF_SPEED = 1.4  # [m/s]
RISE = 0.05  # of the centre of mass while pushing [m]


@pytest.fixture(scope="session")
def robot() -> Robot:
    return Robot.load("mini_cheetah")


@pytest.fixture(scope="session")
def gains(robot: Robot) -> ControllerGains:
    return robot.section("controller", ControllerGains)


@pytest.fixture
def state_at(robot: Robot):
    """The robot in a random, moderate state: ``state_at(seed)``; ``moving=False`` for one at rest at home."""
    kinematics = Kinematics(robot)

    def state_at(seed: int = 0, *, moving: bool = True):
        random = np.random.default_rng(seed)
        q = robot.standing_configuration()
        v = np.zeros(robot.model.nv)
        if moving:
            q[BASE_ORIENTATION] = rotation.exp(random.uniform(-0.5, 0.5, 3))
            q[JOINT_POSITION] += random.uniform(-0.4, 0.4, robot.n_joints)
            v = random.uniform(-1.0, 1.0, robot.model.nv)
        return kinematics.at(q, v)

    return state_at


@pytest.fixture
def target_at(robot, gains):
    """A target that a state meets exactly, for loaded points ``contact``; ``changes`` move its body."""

    def target_at(state, contact, **changes):
        zero = np.zeros(3)
        body = {
            "com": state.com,
            "com_velocity": state.com_velocity,
            "com_acceleration": zero,
            "orientation": state.base_orientation,
            "angular_velocity": state.R_WB @ state.v[3:6],
            "angular_acceleration": zero,
        }
        target = blank_target(robot.n_joints, robot.n_contacts, gains.follow)
        for name, value in {**body, **changes}.items():
            getattr(target.body, name)[:] = value
        target.joint_position[:] = state.q[JOINT_POSITION]
        target.joint_velocity[:] = state.v[JOINT_VELOCITY]
        target.angular_momentum[:] = state.angular_momentum
        target.contact[:] = contact
        return target

    return target_at


@pytest.fixture(scope="session")
def prioritized():
    """q̈ and q̇_ref of tasks in falling priority, for a mass matrix H: ``prioritized(H, tasks)``."""

    def prioritized(H, tasks):
        L = np.zeros_like(H)
        factorize(H, L)
        memory, owned = no_tasks(L), 0
        for task in tasks:
            owned = add_by_null_space(memory, owned, task)
        vdot, v_ref = np.empty((2, len(H)))
        least_energy_solution(memory, vdot, v_ref)
        return vdot, v_ref

    return prioritized


@pytest.fixture(scope="session")
def commanded():
    """q̈ and q̇_ref of the controller's tasks: ``commanded(state, target, joints, ordering)``."""

    def commanded(state, target, joints, ordering):
        vdot, v_ref = np.empty((2, len(state.v)))
        command(state.block, target.block, joints.block, ordering.block, vdot, v_ref)
        return vdot, v_ref

    return commanded


@pytest.fixture(scope="session")
def hop(robot: Robot) -> Plan:
    """A plan of a hop on the spot: a push along a quintic, legs by inverse kinematics, a ballistic flight."""
    home = robot.standing_configuration()
    at_home = Kinematics(robot).at(home, np.zeros(robot.model.nv))
    com_0, feet = at_home.com, at_home.contact_positions
    flight_time = 2 * TAKE_OFF_SPEED / GRAVITY  # the landing pose is that of take-off
    time = np.concatenate(
        [np.arange(0.0, PUSH_TIME - DT / 2, DT), PUSH_TIME + np.arange(0.0, flight_time, DT), [PUSH_TIME + flight_time]]
    )
    height, speed, acceleration = np.array([_height(t) for t in time]).T
    pushing = time < PUSH_TIME - DT / 2
    com = com_0 + np.outer(height, [0.0, 0.0, 1.0])
    q, v = _configurations(robot, home, com, feet, time, int(pushing.sum()))
    share = np.linalg.lstsq(
        np.vstack([np.ones(len(feet)), (feet - com_0)[:, :2].T]), np.array([1.0, 0.0, 0.0]), rcond=None
    )[0]
    lift = np.where(pushing, robot.mass * (acceleration + GRAVITY), 0.0)
    force = np.zeros((len(time), len(feet), 3))
    force[:, :, 2] = np.outer(lift, share)
    return Plan(
        motion="hop",
        robot=robot.name,
        model_hash=robot.model_hash,
        time=time,
        q=q,
        v=v,
        com=com,
        com_velocity=np.outer(speed, [0.0, 0.0, 1.0]),
        angular_momentum=np.zeros((len(time), 3)),
        foot_position=np.array([robot.contact_positions(row) for row in q]),
        force=force,
        contact=np.repeat(pushing[:, None], len(feet), axis=1),
        take_off_time=PUSH_TIME,
        landing_time=float(time[-1]),
        landing_joint_position=q[-1, JOINT_POSITION],
        landing_com_height=float(com_0[2]),
        landing_support_centre=np.zeros(3),
        landing_yaw=0.0,
        rotation=np.zeros(3),
        request_id="hop",
    )


def _configurations(robot, home, com, feet, time, pushing):
    """Configurations and velocities with the feet where they are for the first ``pushing`` knots, then flying as one."""
    q = [home]
    for target in com[: pushing + 1]:
        q.append(_inverse_kinematics(robot, q[-1], target, feet))
    q = np.array(q[1:] + [_moved(robot, q[-1], target) for target in com[pushing + 1 :]])
    v = np.array(
        [pin.difference(robot.model, a, b) / step for a, b, step in zip(q, q[1:], np.diff(time), strict=False)]
    )
    return q, np.vstack([v, v[-1:]])


def _height(time: float) -> tuple[float, float, float]:
    """Return height over rest, speed and acceleration of the centre of mass; the push ends without force."""
    if time >= PUSH_TIME:
        t = time - PUSH_TIME
        return RISE + TAKE_OFF_SPEED * t - GRAVITY * t**2 / 2, TAKE_OFF_SPEED - GRAVITY * t, -GRAVITY
    ends = np.array([RISE, TAKE_OFF_SPEED, -GRAVITY])
    T = PUSH_TIME
    A = np.array([[T**3, T**4, T**5], [3 * T**2, 4 * T**3, 5 * T**4], [6 * T, 12 * T**2, 20 * T**3]])
    quintic = np.polynomial.Polynomial([0.0, 0.0, 0.0, *np.linalg.solve(A, ends)])
    return quintic(time), quintic.deriv()(time), quintic.deriv(2)(time)


def _inverse_kinematics(robot: Robot, q: np.ndarray, com: np.ndarray, feet: np.ndarray) -> np.ndarray:
    """Return the level configuration with the centre of mass at ``com`` and the contact points at ``feet``."""
    kinematics = Kinematics(robot)
    for _ in range(20):
        state = kinematics.at(q, np.zeros(robot.model.nv))
        level = np.eye(6, robot.model.nv)[3:]
        J = np.vstack([state.A_G[3:] / robot.mass, level, state.J_contacts.reshape(-1, robot.model.nv)])
        error = np.concatenate([com - state.com, np.zeros(3), (feet - state.contact_positions).ravel()])
        q = pin.integrate(robot.model, q, np.linalg.lstsq(J, error, rcond=None)[0])
    return q


def _moved(robot: Robot, q: np.ndarray, com: np.ndarray) -> np.ndarray:
    """Return ``q`` moved as a whole so that the centre of mass is at ``com``."""
    q = q.copy()
    q[BASE_POSITION] += com - Kinematics(robot).at(q, np.zeros(robot.model.nv)).com
    return q
