"""Whether the robot can do a plan from where it is."""

from __future__ import annotations

import numpy as np

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_LINEAR, BASE_ORIENTATION, JOINT_POSITION, Robot
from aerial_model.values.estimate import Estimate
from aerial_model.values.plan import Plan
from aerial_wbic.gains import ControllerGains


def check_start(plan: Plan, estimate: Estimate, robot: Robot, gains: ControllerGains) -> None:
    """Check that a robot that stands at ``estimate`` is where ``plan``, in its start heading frame, begins.

    Raises:
        RefusalError: with what differs, by how much, and how much is allowed.
    """
    off = np.abs(plan.start_joint_position - estimate.q[JOINT_POSITION])
    worst = int(np.argmax(off))
    if off[worst] > gains.start_joint_tolerance:
        raise RefusalError(
            RefusalCode.START_MISMATCH,
            f"the plan starts with joint '{robot.joint_names[worst]}' {off[worst]:.3f} rad from where it is; "
            f"allowed: {gains.start_joint_tolerance} rad",
        )
    here = rotation.multiply(
        rotation.about_z(-rotation.heading(estimate.q[BASE_ORIENTATION])), estimate.q[BASE_ORIENTATION]
    )
    turn = rotation.log(rotation.multiply(plan.q[0, BASE_ORIENTATION], rotation.conjugate(here)))
    if np.linalg.norm(turn) > gains.start_tilt_tolerance:
        raise RefusalError(
            RefusalCode.START_MISMATCH,
            f"the plan starts with the base turned by {np.linalg.norm(turn):.3f} rad from how it stands; "
            f"allowed: {gains.start_tilt_tolerance} rad",
        )
    speed = float(np.linalg.norm(estimate.v[BASE_LINEAR]))
    if speed > gains.start_speed_tolerance:
        raise RefusalError(
            RefusalCode.NOT_STANDING,
            f"the robot moves at {speed:.2f} m/s; a plan is taken below {gains.start_speed_tolerance} m/s",
        )
