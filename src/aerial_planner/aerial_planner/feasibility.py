"""Cheap tests that refuse hopeless goals before anything is optimized."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.robot.robot import GRAVITY, Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.assembly.checks import check_landing_feet
from aerial_planner.motion import Schedule
from aerial_planner.reference import Reference

_GROUND_TOLERANCE = 1e-6  # between heights that are meant to be equal [m]


def screen(request: MotionRequest, schedule: Schedule, reference: Reference, robot: Robot) -> None:
    """Check that terrain, stance and goal agree, and that the take-off's energy is within the motors' power.

    Raises:
        RefusalError: naming what binds.
    """
    ground = float(request.terrain.height(schedule.landing_centre))
    if abs(ground - schedule.landing_centre[2]) > _GROUND_TOLERANCE:
        raise RefusalError(
            RefusalCode.INVALID_REQUEST,
            f"the goal is {schedule.landing_centre[2]:.2f} m high, but the ground there is {ground:.2f} m high",
        )
    _check_stance(request, schedule, reference, robot)
    check_landing_feet(request.terrain, _landing_feet(schedule, reference, robot), ground, robot)
    begin, end = reference.com_velocity[0], reference.com_velocity[-1]
    gained = 0.5 * float(end @ end) - 0.5 * float(begin @ begin)
    energy = robot.mass * (gained + GRAVITY * (reference.com[-1, 2] - reference.com[0, 2]))
    law = robot.actuators
    # No motor gives more mechanical power than V²/4R (matched load), nor more than full torque at the speed left for it.
    matched = np.minimum(law.torque_max, 0.5 * law.bus_voltage / law.volts_per_torque)
    speed = (law.bus_voltage - matched * law.volts_per_torque) / law.volts_per_speed
    available = float(np.sum(matched * speed)) * schedule.take_off_time
    if energy > available:
        raise RefusalError(
            RefusalCode.OUT_OF_REACH,
            f"out of reach: the take-off needs {energy:.0f} J, all motors together give {available:.0f} J "
            f"in {schedule.take_off_time:.2f} s",
        )


def _check_stance(request: MotionRequest, schedule: Schedule, reference: Reference, robot: Robot) -> None:
    """Check that every foot that bears load in the take-off does so on the ground jumped from."""
    feet = reference.foot_position[:-1]
    heights = np.where(schedule.contact, request.terrain.height(feet), 0.0)
    for k, i in np.argwhere(np.abs(heights) > _GROUND_TOLERANCE)[:1]:
        x, y, _ = feet[k, i]
        raise RefusalError(
            RefusalCode.INVALID_REQUEST,
            f"platform edge: foot {robot.contact_points[i].name} stands at x {x:.2f}, y {y:.2f} m, where the terrain "
            f"asked for is {heights[k, i]:.2f} m high; the ground jumped from is 0 m high",
        )


def _landing_feet(schedule: Schedule, reference: Reference, robot: Robot) -> np.ndarray:
    """Return where the contact points ``(n_c, 3)`` [m] meet the ground if all goes as in the reference, in S."""
    q = np.concatenate([np.zeros(3), schedule.landing_orientation, reference.landing_joint_position])
    com = pin.centerOfMass(robot.model, robot.model.createData(), q)
    return robot.contact_positions(q) + reference.landing_com - schedule.arms_shift - com
