"""From an optimized take-off to a timed plan: consistent velocities, then the finely integrated flight."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

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
from aerial_planner.assembly.flight import ArmCourse, LiftOff, integrate_flight
from aerial_planner.assembly.velocities import consistent_velocities, flying_velocities
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.kinematics.base_frame import BaseFrameModel
from aerial_planner.motion.schedule import Schedule
from aerial_planner.reference.body import Reference
from aerial_planner.reference.flight_path import FlightPath

_FLIGHT_STEP = 0.01  # of the flight's integration and of the plan's samples there [s]


class _Rows(NamedTuple):
    """The state at K times, in S; names and units as in ``Plan``."""

    time: np.ndarray
    q: np.ndarray
    v: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray
    angular_momentum: np.ndarray


def assemble(
    request: MotionRequest,
    robot: Robot,
    model: BaseFrameModel,
    schedule: Schedule,
    reference: Reference,
    take_off: TakeOffTrajectory,
) -> Plan:
    """Return the plan of an optimized take-off, in S: its knots, then the flight at finer times."""
    ground = _take_off_rows(robot, model, schedule, reference.start_velocity, take_off)
    flight = _flight_rows(robot, model, reference.flight_path, take_off, ground)
    rows = _Rows(*(np.concatenate([before, after[1:]]) for before, after in zip(ground, flight, strict=True)))
    K, N, n_c = len(rows.time), len(schedule.contact), robot.n_contacts
    contact, force = np.zeros((K, n_c), dtype=bool), np.zeros((K, n_c, 3))
    contact[:N], force[:N] = schedule.contact, take_off.force
    return Plan(
        motion=request.motion,
        robot=robot.name,
        model_hash=robot.model_hash,
        **rows._asdict(),
        foot_position=_feet(model, rows.q),
        force=force,
        contact=contact,
        take_off_time=float(ground.time[-1]),
        landing_time=float(rows.time[-1]),
        landing_joint_position=rows.q[-1, JOINT_POSITION],
        landing_com_height=reference.landing_com_height,
        landing_support_centre=schedule.landing_centre,
        landing_yaw=schedule.landing_yaw,
        rotation=accumulated_rotation(rows.time, rows.q, rows.v),
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


def accumulated_rotation(time: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return ∫ω dt ``(3,)`` [rad] in S over a trajectory, by the trapezoidal rule."""
    omega = np.einsum("kab,kb->ka", rotation.matrix(q[:, 3:7]), v[:, 3:6])
    return np.trapezoid(omega, time, axis=0)


def _take_off_rows(
    robot: Robot, model: BaseFrameModel, schedule: Schedule, start_velocity: np.ndarray, take_off: TakeOffTrajectory
) -> _Rows:
    """Return the states at the N + 1 take-off knots.

    The optimizer's Euler rates miss its own momentum and its fixed feet by a few per cent; the plan's velocities are the
    nearest that satisfy A_G q̇ = [α; m ṙ] and J_c q̇ = 0 exactly. The first are those the motion starts with.
    """
    N = len(schedule.contact)
    rates, omega = _at_knots(take_off.joint_velocity), _at_knots(take_off.angular_velocity)
    momentum = np.hstack([robot.mass * take_off.com_velocity, take_off.angular_momentum])  # linear first
    q = _configurations(model, take_off.com, take_off.orientation, take_off.joint_position)
    held = np.vstack([schedule.contact, schedule.contact[-1:]])
    held[1:] |= held[:-1]  # a foot that leaves the ground starts from rest
    v = consistent_velocities(robot, q, np.hstack([np.zeros((N + 1, 3)), omega, rates]), momentum, held)
    v[0] = start_velocity
    return _Rows(
        time=np.concatenate([[0.0], np.cumsum(take_off.dt)]),
        q=q,
        v=v,
        com=take_off.com,
        com_velocity=take_off.com_velocity,
        angular_momentum=take_off.angular_momentum,
    )


def _flight_rows(
    robot: Robot, model: BaseFrameModel, path: FlightPath, take_off: TakeOffTrajectory, ground: _Rows
) -> _Rows:
    """Return the states of the flight, from the last take-off knot on: the centre of mass falls, α is conserved."""
    alpha = take_off.angular_momentum[-1]
    lift_off = LiftOff(
        orientation=take_off.orientation[-1],
        angular_momentum=alpha,
        joint_position=take_off.joint_position[-1],
        joint_velocity=ground.v[-1, JOINT_VELOCITY],
    )
    arms = ArmCourse(joints=robot.arms, position=take_off.flight_joint_position[:, robot.arms])
    flight = integrate_flight(model, path, lift_off, arms, duration=take_off.flight_time, step=_FLIGHT_STEP)
    t, fall = flight.time[:, None], np.array([0.0, 0.0, GRAVITY])
    com = take_off.com[-1] + take_off.com_velocity[-1] * t - 0.5 * fall * t**2
    com_velocity = take_off.com_velocity[-1] - fall * t
    q = _configurations(model, com, flight.orientation, flight.joint_position)
    angular_momentum = np.tile(alpha, (len(q), 1))
    momentum = np.hstack([robot.mass * com_velocity, angular_momentum])
    return _Rows(
        time=ground.time[-1] + flight.time,
        q=q,
        v=flying_velocities(robot, q, flight.joint_velocity, momentum),
        com=com,
        com_velocity=com_velocity,
        angular_momentum=angular_momentum,
    )


def _at_knots(rates: np.ndarray) -> np.ndarray:
    """Return velocities at the knots ``(N+1, m)`` given those of Euler's steps between them, and the last; zero at the first."""
    velocity = np.vstack([np.zeros(rates.shape[1]), rates[1:]])
    velocity[1:-1] = 0.5 * (rates[:-2] + rates[1:-1])
    return velocity


def _configurations(model: BaseFrameModel, com: np.ndarray, orientation: np.ndarray, q_j: np.ndarray) -> np.ndarray:
    """Return q ``(K, nq)``: the base stands where the centre of mass asks (3.7)."""
    base = com - np.einsum("kab,kb->ka", rotation.matrix(orientation), model.coms(q_j))
    return np.hstack([base, orientation, q_j])


def _feet(model: BaseFrameModel, q: np.ndarray) -> np.ndarray:
    """Return the contact points ``(K, n_c, 3)`` at configurations ``(K, nq)``, in their frame."""
    turned = np.einsum("kab,kib->kia", rotation.matrix(q[:, BASE_ORIENTATION]), model.feet_at(q[:, JOINT_POSITION]))
    return q[:, None, BASE_POSITION] + turned
