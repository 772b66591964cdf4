"""From an optimized take-off to a timed plan: consistent velocities, the finely integrated flight, exact torques."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from aerial_model.numerics import rotation
from aerial_model.robot.robot import (
    BASE_ORIENTATION,
    BASE_POSITION,
    BASE_TWIST,
    GRAVITY,
    JOINT_POSITION,
    JOINT_VELOCITY,
    Robot,
)
from aerial_model.values.plan import Plan
from aerial_model.values.request import MotionRequest
from aerial_planner.assembly.flight import integrate_flight
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.motion.schedule import Schedule
from aerial_planner.reference.body import Reference

_FLIGHT_STEP = 0.01  # of the flight's integration and of the plan's samples there [s]
_SAME_TIME = 1e-9  # [s]
_DAMPING = 1e-11  # of normal equations, as a share of their trace
_STICTION_SPEED = 0.1  # smoothing of Coulomb friction in exact torques [rad/s]


@dataclass(frozen=True, kw_only=True)
class ActuatorUse:
    """Exact motor torques of a plan between its knots, and what they take of the limits."""

    torque: np.ndarray  # (K-1, n) motor torque, losses and rotor inertia included [N·m]
    speed: np.ndarray  # (K-1, n) [rad/s]
    torque_ratio: np.ndarray  # (K-1, n) of the limit
    voltage_ratio: np.ndarray  # (K-1, n)
    speed_ratio: np.ndarray  # (K-1, n)
    flying: np.ndarray  # (K-1,) bool
    base_wrench_error: float  # largest force the plan's accelerations would need from nowhere, as a share of the weight

    @property
    def in_take_off(self) -> np.ndarray:
        """Greatest torque or voltage of each joint over its limit while contacts push ``(n,)``."""
        return self._worst[~self.flying].max(axis=0)

    @property
    def at_lift_off(self) -> np.ndarray:
        """That of each joint as the flight begins ``(n,)``."""
        return self._worst[self.flying][0]

    @property
    def in_flight(self) -> np.ndarray:
        """That of each joint in flight ``(n,)``."""
        return self._worst[self.flying].max(axis=0)

    @property
    def _worst(self) -> np.ndarray:
        return np.maximum(self.torque_ratio, self.voltage_ratio)


def assemble(
    request: MotionRequest,
    robot: Robot,
    model: BaseFrameModel,
    schedule: Schedule,
    reference: Reference,
    take_off: TakeOffTrajectory,
) -> Plan:
    """Return the plan of an optimized take-off, in S.

    The optimizer's Euler rates miss its own momentum and its fixed feet by a few per cent; the plan's velocities are the
    nearest that satisfy A_G q̇ = [α; m ṙ] and J_c q̇ = 0 exactly.
    """
    N = len(schedule.contact)
    rates, omega = _at_knots(take_off.joint_velocity), _at_knots(take_off.angular_velocity)
    momentum = np.hstack([robot.mass * take_off.com_velocity, take_off.angular_momentum])  # linear first
    q = _configurations(model, take_off.com, take_off.orientation, take_off.joint_position)
    held = np.vstack([schedule.contact, schedule.contact[-1:]])
    held[1:] |= held[:-1]  # a foot that leaves the ground starts from rest
    v = _consistent_velocities(robot, q, np.hstack([np.zeros((N + 1, 3)), omega, rates]), momentum, held)
    flight = integrate_flight(
        model,
        reference.flight_path,
        duration=take_off.flight_time,
        orientation=take_off.orientation[-1],
        angular_momentum=take_off.angular_momentum[-1],
        joint_position=take_off.joint_position[-1],
        joint_velocity=v[-1, JOINT_VELOCITY],
        arms=robot.arms,
        arm_position=take_off.flight_joint_position[:, robot.arms],
        step=_FLIGHT_STEP,
    )
    t = flight.time[:, None]
    fall = np.array([0.0, 0.0, GRAVITY])
    com = take_off.com[-1] + take_off.com_velocity[-1] * t - 0.5 * fall * t**2
    com_velocity = take_off.com_velocity[-1] - fall * t
    alpha = take_off.angular_momentum[-1]
    flight_q = _configurations(model, com, flight.orientation, flight.joint_position)
    flight_momentum = np.hstack([robot.mass * com_velocity, np.tile(alpha, (len(flight_q), 1))])
    flight_v = _flying_velocities(robot, flight_q, flight.joint_velocity, flight_momentum)
    q = np.vstack([q, flight_q[1:]])
    v = np.vstack([v, flight_v[1:]])
    K, n_c = len(q), robot.n_contacts
    contact, force = np.zeros((K, n_c), dtype=bool), np.zeros((K, n_c, 3))
    contact[:N], force[:N] = schedule.contact, take_off.force
    take_off_time = np.concatenate([[0.0], np.cumsum(take_off.dt)])
    time = np.concatenate([take_off_time, take_off_time[-1] + flight.time[1:]])
    return Plan(
        motion=request.motion,
        robot=robot.name,
        model_hash=robot.model_hash,
        time=time,
        q=q,
        v=v,
        com=np.vstack([take_off.com, com[1:]]),
        com_velocity=np.vstack([take_off.com_velocity, com_velocity[1:]]),
        angular_momentum=np.vstack([take_off.angular_momentum, np.tile(alpha, (K - N - 1, 1))]),
        foot_position=_feet(model, q),
        force=force,
        contact=contact,
        take_off_time=float(take_off_time[-1]),
        landing_time=float(time[-1]),
        landing_joint_position=flight.joint_position[-1],
        landing_com_height=reference.landing_com_height,
        landing_support_centre=schedule.landing_centre,
        landing_yaw=schedule.landing_yaw,
        rotation=accumulated_rotation(time, q, v),
        terrain=request.terrain,
        request_id=request.request_id,
    )


def with_held_joints(plan: Plan, robot: Robot) -> Plan:
    """Return the plan of ``robot.planned`` as one of the whole robot."""
    if not robot.held_joints.any():
        return plan
    still = np.zeros((len(plan.time), robot.n_joints))
    still[:, robot.planned_joints] = plan.v[:, JOINT_VELOCITY]
    return dataclasses.replace(
        plan,
        q=np.hstack([plan.q[:, : JOINT_POSITION.start], robot.with_held(plan.q[:, JOINT_POSITION])]),
        v=np.hstack([plan.v[:, BASE_TWIST], still]),
        landing_joint_position=robot.with_held(plan.landing_joint_position),
    )


def arms_shift(plan: Plan, robot: Robot, expected: np.ndarray) -> np.ndarray:
    """Return by how much ``(3,)`` [m] arms at touchdown that are not where ``expected`` ``(n,)`` shift the centre of mass, in S."""
    as_expected = plan.q[-1].copy()
    as_expected[JOINT_POSITION][robot.arms] = expected[robot.arms]
    data = robot.model.createData()
    centres = [pin.centerOfMass(robot.model, data, q).copy() for q in (plan.q[-1], as_expected)]
    return centres[0] - centres[1]


def _at_knots(rates: np.ndarray) -> np.ndarray:
    """Return velocities at the knots ``(N+1, m)`` from rest, given those of Euler's steps between them, and the last."""
    velocity = np.vstack([np.zeros(rates.shape[1]), rates[1:]])
    velocity[1:-1] = 0.5 * (rates[:-2] + rates[1:-1])
    return velocity


def accumulated_rotation(time: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return ∫ω dt ``(3,)`` [rad] in S over a trajectory, by the trapezoidal rule."""
    omega = np.einsum("kab,kb->ka", rotation.matrix(q[:, 3:7]), v[:, 3:6])
    return np.trapezoid(omega, time, axis=0)


def actuator_use(plan: Plan, robot: Robot) -> ActuatorUse:
    """Return the exact torques of a plan: inverse dynamics with exact Jacobians at mid-interval, plus losses."""
    law = robot.actuators
    data = robot.model.createData()
    dt = np.diff(plan.time)
    v, a = 0.5 * (plan.v[:-1] + plan.v[1:]), np.diff(plan.v, axis=0) / dt[:, None]
    tau = np.empty_like(v)
    for k in range(len(dt)):
        q = pin.interpolate(robot.model, plan.q[k], plan.q[k + 1], 0.5)
        tau[k] = pin.rnea(robot.model, data, q, v[k], a[k])
        if plan.contact[k].any():
            pin.computeJointJacobians(robot.model, data, q)
        for i in np.flatnonzero(plan.contact[k]):
            J = pin.getFrameJacobian(robot.model, data, robot.contact_frames[i], pin.LOCAL_WORLD_ALIGNED)[:3]
            tau[k] -= J.T @ plan.force[k, i]
    speed = v[:, JOINT_VELOCITY]
    torque = tau[:, JOINT_VELOCITY] + law.friction(speed, _STICTION_SPEED)
    gap = float(np.linalg.norm(tau[:, :3], axis=1).max())
    return ActuatorUse(
        torque=torque,
        speed=speed,
        torque_ratio=law.torque_ratio(torque),
        voltage_ratio=law.voltage_ratio(torque, speed),
        speed_ratio=law.speed_ratio(speed),
        flying=plan.time[:-1] >= plan.take_off_time - _SAME_TIME,
        base_wrench_error=gap / (robot.mass * GRAVITY),
    )


def _configurations(model: BaseFrameModel, com: np.ndarray, orientation: np.ndarray, q_j: np.ndarray) -> np.ndarray:
    """Return q ``(K, nq)``: the base stands where the centre of mass asks (3.7)."""
    base = com - np.einsum("kab,kb->ka", rotation.matrix(orientation), model.coms(q_j))
    return np.hstack([base, orientation, q_j])


def _feet(model: BaseFrameModel, q: np.ndarray) -> np.ndarray:
    """Return the contact points ``(K, n_c, 3)`` at configurations ``(K, nq)``, in their frame."""
    turned = np.einsum("kab,kib->kia", rotation.matrix(q[:, BASE_ORIENTATION]), model.feet_at(q[:, JOINT_POSITION]))
    return q[:, None, BASE_POSITION] + turned


def _consistent_velocities(
    robot: Robot, q: np.ndarray, v: np.ndarray, momentum: np.ndarray, held: np.ndarray
) -> np.ndarray:
    """Return the velocities nearest to ``v`` ``(K, nv)`` with these momenta ``(K, 6)``, linear first, and feet ``held`` at rest.

    Rows may depend on each other, as those of all feet of a robot with few joints do: the normal equations are damped, and
    solved a second time for what that left.
    """
    data = robot.model.createData()
    A = np.zeros((len(q), 6 + 3 * robot.n_contacts, robot.model.nv))
    for k in range(len(q)):
        A[k, :6] = pin.computeCentroidalMap(robot.model, data, q[k])
        pin.computeJointJacobians(robot.model, data, q[k])
        pin.updateFramePlacements(robot.model, data)
        for i in np.flatnonzero(held[k]):
            J = pin.getFrameJacobian(robot.model, data, robot.contact_frames[i], pin.LOCAL_WORLD_ALIGNED)
            A[k, 6 + 3 * i : 9 + 3 * i] = J[:3]
    b = np.zeros(A.shape[:2])
    b[:, :6] = momentum
    transposed = A.transpose(0, 2, 1)
    normal = A @ transposed
    normal += _DAMPING * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(A.shape[1])
    for _ in range(2):
        missing = b - np.einsum("kij,kj->ki", A, v)
        v = v + np.einsum("kij,kj->ki", transposed, np.linalg.solve(normal, missing[..., None])[..., 0])
    return v


def _flying_velocities(robot: Robot, q: np.ndarray, joint_velocity: np.ndarray, momentum: np.ndarray) -> np.ndarray:
    """Return v ``(K, nv)`` with these joint rates and these momenta ``(K, 6)``, linear first."""
    data = robot.model.createData()
    A = np.array([pin.computeCentroidalMap(robot.model, data, configuration).copy() for configuration in q])
    left = momentum - np.einsum("kij,kj->ki", A[:, :, JOINT_VELOCITY], joint_velocity)
    return np.hstack([np.linalg.solve(A[:, :, BASE_TWIST], left[..., None])[..., 0], joint_velocity])
