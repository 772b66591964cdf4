"""Whether the robot can do a plan from where it is and how it moves."""

from __future__ import annotations

import numpy as np

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.kinematics import Kinematics
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_LINEAR, BASE_ORIENTATION, JOINT_POSITION, Robot
from aerial_model.values.estimate import Estimate
from aerial_model.values.plan import Plan
from aerial_wbic.gains import ControllerGains


def check_start(plan: Plan, estimate: Estimate, robot: Robot, gains: ControllerGains) -> None:
    """Check that a robot at ``estimate`` is where ``plan``, in its start heading frame, begins, and moves as it begins.

    A plan that begins at rest is taken below the speed limit of standing, one that begins in motion near its own velocity.

    Raises:
        RefusalError: with what differs, by how much, and how much is allowed.
    """
    if not plan.contact[0].any():
        raise RefusalError(
            RefusalCode.INVALID_PLAN, "the plan begins with no contact point that bears load; expected one at least"
        )
    _check_joints(plan, estimate, robot, gains)
    _check_attitude(plan, estimate, gains)
    if begins_in_motion(plan, gains):
        _check_motion(plan, estimate, robot, gains)
    else:
        _check_rest(estimate, gains)


def begins_in_motion(plan: Plan, gains: ControllerGains) -> bool:
    """Return whether a plan begins faster than a robot may move that counts as standing."""
    speed, momentum = np.linalg.norm(plan.v[0, BASE_LINEAR]), np.linalg.norm(plan.angular_momentum[0])
    return bool(speed > gains.start_speed_tolerance or momentum > gains.start_momentum_tolerance)


def _check_joints(plan: Plan, estimate: Estimate, robot: Robot, gains: ControllerGains) -> None:
    off = np.abs(plan.start_joint_position - estimate.q[JOINT_POSITION])
    worst = int(np.argmax(off))
    if off[worst] > gains.start_joint_tolerance:
        raise RefusalError(
            RefusalCode.START_MISMATCH,
            f"the plan starts with joint '{robot.joint_names[worst]}' {off[worst]:.3f} rad from where it is; "
            f"allowed: {gains.start_joint_tolerance} rad",
        )


def _check_attitude(plan: Plan, estimate: Estimate, gains: ControllerGains) -> None:
    here = rotation.multiply(_heading_undone(estimate), estimate.q[BASE_ORIENTATION])
    turn = rotation.log(rotation.multiply(plan.q[0, BASE_ORIENTATION], rotation.conjugate(here)))
    if np.linalg.norm(turn) > gains.start_tilt_tolerance:
        raise RefusalError(
            RefusalCode.START_MISMATCH,
            f"the plan starts with the base turned by {np.linalg.norm(turn):.3f} rad from how it stands; "
            f"allowed: {gains.start_tilt_tolerance} rad",
        )


def _check_rest(estimate: Estimate, gains: ControllerGains) -> None:
    speed = float(np.linalg.norm(estimate.v[BASE_LINEAR]))
    if speed > gains.start_speed_tolerance:
        raise RefusalError(
            RefusalCode.NOT_STANDING,
            f"the robot moves at {speed:.2f} m/s; a plan that begins at rest is taken below "
            f"{gains.start_speed_tolerance} m/s",
        )


def _check_motion(plan: Plan, estimate: Estimate, robot: Robot, gains: ControllerGains) -> None:
    """Compare the base's velocity, in B, and the angular momentum about the centre of mass, in the heading frame."""
    off = float(np.linalg.norm(plan.v[0, BASE_LINEAR] - estimate.v[BASE_LINEAR]))
    if off > gains.start_velocity_tolerance:
        raise RefusalError(
            RefusalCode.START_MISMATCH,
            f"the plan starts with a base velocity {off:.2f} m/s from the robot's; "
            f"allowed: {gains.start_velocity_tolerance} m/s",
        )
    momentum = Kinematics(robot).at(estimate.q, estimate.v).angular_momentum
    here = rotation.matrix(_heading_undone(estimate)) @ momentum
    off = float(np.linalg.norm(plan.angular_momentum[0] - here))
    if off > gains.start_momentum_tolerance:
        raise RefusalError(
            RefusalCode.START_MISMATCH,
            f"the plan starts with an angular momentum {off:.2f} kg·m²/s from the robot's; "
            f"allowed: {gains.start_momentum_tolerance:.3g} kg·m²/s",
        )


def _heading_undone(estimate: Estimate) -> np.ndarray:
    """Return the rotation ``(4,)`` from W's axes to those of the heading frame."""
    return rotation.about_z(-rotation.heading(estimate.q[BASE_ORIENTATION]))
