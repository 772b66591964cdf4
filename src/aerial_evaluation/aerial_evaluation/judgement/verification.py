"""A plan against an independent integrator: its forces lift the robot off, MuJoCo's full dynamics fly it.

Up to lift-off the planned forces, acting at the planned contact points, are integrated to the state of the centre of
mass and its angular momentum. From there MuJoCo integrates all bodies; joint torques make the joints follow the planned
joint motion, and nothing touches the base. What the robot lands like is compared with the *goal*, not with the plan.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, BASE_POSITION, JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_model.values.plan import Plan
from aerial_model.values.terrain import Terrain
from aerial_sim.conditions import PHYSICS_STEP
from aerial_sim.world.world import XYZW, World, build

ATTITUDE_TOLERANCE = np.deg2rad(3.0)  # of the landing attitude [rad]
POSITION_TOLERANCE = 0.03  # of the landing feet's centre [m]
TURN_TOLERANCE = np.deg2rad(15.0)  # between planned and simulated accumulated rotation [rad]
FORCE_STEPS = 10  # of the take-off's integration per interval of the plan
STIFFNESS, DAMPING = 1e4, 200.0  # with which joints follow [1/s²], [1/s]: drift of the integration only
GRAVITY = np.array([0.0, 0.0, -9.81])
# Feet leave and meet the ground at the ends of a flight; dry friction and damping are the motors' to overcome.
_DISABLED = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS


@dataclass(frozen=True, kw_only=True)
class Verification:
    """How far a plan's goal is missed when somebody else integrates it."""

    momentum_error: float  # of the angular momentum at lift-off, from the planned one [kg·m²/s]
    take_off_velocity_error: float  # of the centre of mass at lift-off, from the planned one [m/s]
    attitude_error: float  # at touchdown, from level at the goal's heading [rad]
    position_error: float  # of the feet's centre at touchdown, from the goal's [m]
    rotation: np.ndarray  # (3,) ∫ω dt from start to touchdown [rad]
    turn_error: float  # its distance from the planned one [rad]

    @property
    def passed(self) -> bool:
        """Whether attitude, position and winding are right."""
        return bool(
            self.attitude_error <= ATTITUDE_TOLERANCE
            and self.position_error <= POSITION_TOLERANCE
            and self.turn_error <= TURN_TOLERANCE
        )

    def to_json(self) -> dict[str, Any]:
        """Return the figures as ``./aerial plan --verify --json`` prints them."""
        return {
            "passed": self.passed,
            "attitude_error_deg": float(np.rad2deg(self.attitude_error)),
            "position_error_m": self.position_error,
            "rotation_deg": np.rad2deg(self.rotation).tolist(),
            "take_off_velocity_error_m_s": self.take_off_velocity_error,
            "take_off_momentum_error": self.momentum_error,
        }


def verify(robot: Robot, plan: Plan) -> Verification:
    """Return how a plan ends when its forces and MuJoCo integrate it; in the plan's frame, which has z up."""
    k = int(np.searchsorted(plan.time, plan.take_off_time - 1e-9))
    com, velocity, momentum = _pushed_off(robot, plan, k)
    world = build(robot, Terrain(), PHYSICS_STEP)
    world.model.opt.disableflags |= _DISABLED
    flight = _Flight(world, plan)
    flight.start(k, com, velocity, momentum)
    turned = _turned_on_the_ground(plan, k) + flight.fly()
    attitude = flight.data.qpos[XYZW]
    miss = rotation.log(rotation.multiply(rotation.conjugate(rotation.about_z(plan.landing_yaw)), attitude))
    radius = np.mean([point.radius for point in robot.contact_points])
    goal = plan.landing_support_centre + [0.0, 0.0, radius]
    return Verification(
        momentum_error=float(np.linalg.norm(momentum - plan.angular_momentum[k])),
        take_off_velocity_error=float(np.linalg.norm(velocity - plan.com_velocity[k])),
        attitude_error=float(np.linalg.norm(miss)),
        position_error=float(np.linalg.norm(flight.feet_centre - goal)),
        rotation=turned,
        turn_error=float(np.linalg.norm(turned - plan.rotation)),
    )


def _pushed_off(robot: Robot, plan: Plan, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return centre of mass [m], its velocity [m/s] and angular momentum [kg·m²/s] at knot ``k`` by the planned forces."""
    r, v, alpha = plan.com[0].copy(), plan.com_velocity[0].copy(), plan.angular_momentum[0].copy()
    for i in range(k):
        h = (plan.time[i + 1] - plan.time[i]) / FORCE_STEPS
        force, feet = plan.force[i], plan.foot_position[i]
        acceleration = force.sum(axis=0) / robot.mass + GRAVITY
        for _ in range(FORCE_STEPS):
            middle = r + 0.5 * h * v
            alpha += h * np.cross(feet - middle, force).sum(axis=0)
            r += h * v + 0.5 * h**2 * acceleration
            v += h * acceleration
    return r, v, alpha


def _turned_on_the_ground(plan: Plan, k: int) -> np.ndarray:
    """Return the rotation ``(3,)`` accumulated up to knot ``k``, from the attitudes alone [rad]."""
    q = plan.q[: k + 1, BASE_ORIENTATION]
    return rotation.log(rotation.multiply(q[1:], rotation.conjugate(q[:-1]))).sum(axis=0)


class _Flight:
    """MuJoCo's flight of a plan."""

    def __init__(self, world: World, plan: Plan) -> None:
        self.world, self.plan = world, plan
        self.data = mujoco.MjData(world.model)

    def start(self, k: int, com: np.ndarray, velocity: np.ndarray, momentum: np.ndarray) -> None:
        """Put the robot at knot ``k`` of the plan, with this state of its centre of mass and momentum."""
        model, data, dofs = self.world.model, self.data, self.world.joint_dof
        data.qpos[:] = self.world.qpos(self.plan.q[k])
        mujoco.mj_fwdPosition(model, data)
        data.qpos[BASE_POSITION] += com - data.subtree_com[self.world.trunk]
        mujoco.mj_fwdPosition(model, data)
        angular, linear = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_angmomMat(model, data, angular, self.world.trunk)
        mujoco.mj_jacSubtreeCom(model, data, linear, self.world.trunk)
        A = np.vstack([linear, angular])
        data.qvel[dofs] = self.plan.v[k, JOINT_VELOCITY]
        data.qvel[:6] = np.linalg.solve(A[:, :6], np.concatenate([velocity, momentum]) - A[:, dofs] @ data.qvel[dofs])
        data.time = self.plan.time[k]

    def fly(self) -> np.ndarray:
        """Fly until the planned touchdown; return the rotation ``(3,)`` turned meanwhile [rad]."""
        model, data = self.world.model, self.data
        turned = np.zeros(3)
        steps = max(1, round((self.plan.landing_time - data.time) / PHYSICS_STEP))
        model.opt.timestep = (self.plan.landing_time - data.time) / steps
        for _ in range(steps):
            before = data.qpos[XYZW].copy()
            mujoco.mj_forward(model, data)
            data.qfrc_applied[self.world.joint_dof] = self._torque()
            mujoco.mj_step(model, data)
            turned += rotation.log(rotation.multiply(data.qpos[XYZW], rotation.conjugate(before)))
        mujoco.mj_fwdPosition(model, data)
        return turned

    @property
    def feet_centre(self) -> np.ndarray:
        """Mean of the contact points ``(3,)`` [m]."""
        return self.data.geom_xpos[self.world.contact_geoms].mean(axis=0)

    def _torque(self) -> np.ndarray:
        """Return the joint torques ``(n,)`` [N·m] that make the joints follow the plan."""
        model, data, dofs = self.world.model, self.data, self.world.joint_dof
        target = self.plan.sample(data.time + 0.5 * model.opt.timestep)
        now = self.plan.sample(data.time)
        error = now.q[JOINT_POSITION] - data.qpos[self.world.joint_qpos]
        error_rate = now.v[JOINT_VELOCITY] - data.qvel[dofs]
        wanted = target.vdot[JOINT_VELOCITY] + STIFFNESS * error + DAMPING * error_rate
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        bias = data.qfrc_bias - data.qfrc_passive
        base = np.linalg.solve(M[:6, :6], -bias[:6] - M[np.ix_(np.arange(6), dofs)] @ wanted)
        return bias[dofs] + M[np.ix_(dofs, np.arange(6))] @ base + M[np.ix_(dofs, dofs)] @ wanted
