"""Where and how a plan lands: figures of its configuration at touchdown."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, JOINT_POSITION, Robot
from aerial_model.values.plan import Plan
from aerial_planner.motion.schedule import Schedule


def landing_position(plan: Plan, robot: Robot) -> np.ndarray:
    """Return the centre of the landing feet at touchdown ``(3,)`` [m] in the plan's frame, z: the surface they meet."""
    radius = np.mean([point.radius for point in robot.contact_points])
    return robot.contact_positions(plan.q[-1]).mean(axis=0) - [0.0, 0.0, radius]


def attitude_miss(plan: Plan, schedule: Schedule) -> np.ndarray:
    """Return by what rotation vector ``(3,)`` [rad], in the base at the goal, the finely integrated landing is off."""
    landed = rotation.multiply(rotation.conjugate(schedule.landing_orientation), plan.q[-1, BASE_ORIENTATION])
    return rotation.log(landed)


def arms_shift(plan: Plan, robot: Robot, expected: np.ndarray) -> np.ndarray:
    """Return by how much ``(3,)`` [m] arms at touchdown that are not where ``expected`` ``(n,)`` shift the centre of mass, in S."""
    as_expected = plan.q[-1].copy()
    as_expected[JOINT_POSITION][robot.arms] = expected[robot.arms]
    data = robot.model.createData()
    centres = [pin.centerOfMass(robot.model, data, q).copy() for q in (plan.q[-1], as_expected)]
    return centres[0] - centres[1]
