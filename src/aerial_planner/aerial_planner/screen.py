"""Cheap tests that refuse hopeless goals before anything is optimized."""

from __future__ import annotations

import numpy as np

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.request import MotionRequest
from aerial_model.robot import Robot
from aerial_planner.reference import Reference
from aerial_planner.schedule import GRAVITY, Schedule


def screen(request: MotionRequest, schedule: Schedule, reference: Reference, robot: Robot) -> None:
    """Check that terrain and goal agree, and that the take-off's energy is within the motors' power.

    Raises:
        RefusalError: naming what binds.
    """
    ground = float(request.terrain.height(schedule.landing_centre))
    if abs(ground - schedule.landing_centre[2]) > 1e-6:
        raise RefusalError(
            RefusalCode.INVALID_REQUEST,
            f"the goal is {schedule.landing_centre[2]:.2f} m high, but the ground there is {ground:.2f} m high",
        )
    velocity = reference.com_velocity[-1]
    energy = robot.mass * (0.5 * float(velocity @ velocity) + GRAVITY * (reference.com[-1, 2] - reference.com[0, 2]))
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
