"""Checks of a plan after the optimization; a plan that fails one is refused, with the reason."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.robot.robot import JOINT_POSITION, Robot
from aerial_model.values.plan import Plan
from aerial_model.values.terrain import Terrain
from aerial_planner.assembly.actuator_use import ActuatorUse
from aerial_planner.assembly.collision import CollisionModel
from aerial_planner.assembly.touchdown import attitude_miss
from aerial_planner.motion.schedule import Schedule
from aerial_planner.ocp.problem import Solution

VIOLATION_TOLERANCE = 1e-4  # of any constraint of the optimization, SI units; a feasible plan may be short of optimal
ACTUATOR_TOLERANCE = 1.05  # exact torque, voltage or speed over its limit
ATTITUDE_TOLERANCE = np.deg2rad(3.0)  # of the finely integrated landing attitude [rad]
TURN_TOLERANCE = np.deg2rad(15.0)  # of the rotation accumulated about the goal's axis [rad]
RANGE_TOLERANCE = np.deg2rad(3.0)  # by which a joint may leave its planning range in flight [rad]
EDGE_MARGIN = 0.02  # of landing feet from a platform's edge [m]
FOOT_CLEARANCE = 0.01  # of flying feet from the ground [m]
_TOUCH_RISE = 0.02  # by which to fly higher when a link would touch the terrain [m]
_SAME_HEIGHT = 1e-6  # by which heights that are meant to be equal differ [m]


class Shortfall(NamedTuple):
    """What a plan misses of its clearance over the terrain."""

    height: float  # by which it should fly higher [m]; 0: feet and links clear the terrain
    reason: str


class PlanChecks:
    """The checks that decide whether a plan of one robot may be handed out.

    Args:
        robot: the whole robot.
        actuator_tolerance: exact torque, voltage or speed over its limit from which a plan is refused.
    """

    def __init__(self, robot: Robot, actuator_tolerance: float = ACTUATOR_TOLERANCE) -> None:
        self.robot = robot
        self.actuator_tolerance = actuator_tolerance
        self._collisions = CollisionModel(robot)

    def check(self, plan: Plan, schedule: Schedule, solution: Solution, use: ActuatorUse) -> None:
        """Check a plan but for its clearance over the terrain, most telling reason first.

        Raises:
            RefusalError: naming what binds.
        """
        _check_solution(solution)
        _check_attitude(plan, schedule)
        _check_turn(plan, schedule)
        _check_actuators(use, plan, self.robot, self.actuator_tolerance)
        _check_joint_range(plan, self.robot)
        check_landing_feet(plan.terrain, plan.foot_position[-1], plan.landing_support_centre[2], self.robot)

    def passes(self, plan: Plan, schedule: Schedule, solution: Solution, use: ActuatorUse) -> bool:
        """Return whether a plan passes ``check``."""
        try:
            self.check(plan, schedule, solution, use)
        except RefusalError:
            return False
        return True

    def shortfall(self, plan: Plan) -> Shortfall:
        """Return by how much a plan should fly higher over the terrain, and why.

        Raises:
            RefusalError: if links touch where more height does not help.
        """
        deficit = clearance_deficit(plan, self.robot)
        touch = self._collisions.first_touch(plan)
        if touch is None:
            return Shortfall(deficit, f"a foot would pass {100 * deficit:.1f} cm too low")
        if touch.is_terrain and plan.take_off_time < touch.time < plan.landing_time:
            return Shortfall(max(deficit, _TOUCH_RISE), str(touch))
        what = "platform edge" if touch.is_terrain else "self-collision"
        raise _refuse(f"{what}: {touch}")


def clearance_deficit(plan: Plan, robot: Robot) -> float:
    """Return by how much [m] the flying feet miss their clearance over the terrain; 0 if they keep it.

    The first and last tenth of the flight, when feet leave and meet the ground they stand on, do not count there.
    """
    flight = plan.landing_time - plan.take_off_time
    flying = (plan.time > plan.take_off_time) & (plan.time < plan.landing_time)
    radii = np.array([point.radius for point in robot.contact_points])
    feet, time = plan.foot_position[flying], plan.time[flying]  # (K, n_c, 3)
    ground = plan.terrain.height(feet, margin=FOOT_CLEARANCE)
    gap = feet[..., 2] - radii - ground
    share = (time - plan.take_off_time) / flight
    start = plan.terrain.height(plan.foot_position[0])
    leaving = (share[:, None] < 0.1) & (ground <= start + _SAME_HEIGHT)
    meeting = (share[:, None] > 0.9) & (np.abs(ground - plan.landing_support_centre[2]) < _SAME_HEIGHT)
    wanted = np.where(leaving | meeting, -FOOT_CLEARANCE, FOOT_CLEARANCE)
    return float(max(0.0, np.max(wanted - gap, initial=0.0)))


def _refuse(reason: str) -> RefusalError:
    return RefusalError(RefusalCode.CHECK_FAILED, reason)


def _check_solution(solution: Solution) -> None:
    if solution.max_violation > VIOLATION_TOLERANCE:
        raise RefusalError(
            RefusalCode.NO_SOLUTION,
            f"no take-off within the limits was found in {solution.iterations} iterations (largest constraint violation "
            f"{solution.max_violation:.2g}); what binds: {', '.join(solution.binding[:3]) or 'nothing in particular'}",
        )


def _check_attitude(plan: Plan, schedule: Schedule) -> None:
    angle = float(np.linalg.norm(attitude_miss(plan, schedule)))
    if angle > ATTITUDE_TOLERANCE:
        raise _refuse(f"landing attitude: {np.rad2deg(angle):.1f}° off the goal when the flight is integrated finely")


def _check_turn(plan: Plan, schedule: Schedule) -> None:
    """Check the accumulated rotation: a flip that does not turn ends in the same attitude."""
    angle = float(np.linalg.norm(schedule.rotation))
    turned = float(plan.rotation @ schedule.rotation / angle) if angle > 0 else float(np.linalg.norm(plan.rotation))
    if abs(turned - angle) > TURN_TOLERANCE:
        raise _refuse(f"rotation: {np.rad2deg(turned):.0f}° are accumulated instead of {np.rad2deg(angle):.0f}°")


def _check_actuators(use: ActuatorUse, plan: Plan, robot: Robot, tolerance: float) -> None:
    for what, ratio in (("torque", use.torque_ratio), ("voltage", use.voltage_ratio), ("speed", use.speed_ratio)):
        k, joint = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
        if ratio[k, joint] > tolerance:
            when = "take-off" if plan.time[k] < plan.take_off_time else "flight"
            raise _refuse(
                f"{robot.joint_names[joint]} {what} in {when}: {100 * ratio[k, joint]:.0f} % of its limit "
                f"at {plan.time[k]:.2f} s"
            )


def _check_joint_range(plan: Plan, robot: Robot) -> None:
    lower, upper = robot.model.lowerPositionLimit[JOINT_POSITION], robot.model.upperPositionLimit[JOINT_POSITION]
    q_j = plan.q[:, JOINT_POSITION]
    excess = np.maximum(lower - q_j, q_j - upper)
    k, joint = np.unravel_index(int(np.argmax(excess)), excess.shape)
    if excess[k, joint] > RANGE_TOLERANCE:
        raise _refuse(
            f"{robot.joint_names[joint]} leaves its range by {np.rad2deg(excess[k, joint]):.1f}° at {plan.time[k]:.2f} s"
        )


def check_landing_feet(terrain: Terrain, feet: np.ndarray, surface: float, robot: Robot) -> None:
    """Check that landing feet ``(n_c, 3)`` stand on the landing surface, away from any edge; all in S [m].

    Raises:
        RefusalError: naming the foot and where it would land.
    """
    for point, foot in zip(robot.contact_points, feet, strict=True):
        offsets = EDGE_MARGIN * np.array([[0, 0], [1, 1], [1, -1], [-1, 1], [-1, -1]])
        ground = terrain.height(foot[:2] + offsets)
        if np.any(np.abs(ground - surface) > _SAME_HEIGHT):
            raise _refuse(
                f"platform edge: foot {point.name} would land at x {foot[0]:.2f}, y {foot[1]:.2f} m, where the ground is "
                f"{ground[np.argmax(np.abs(ground - surface))]:.2f} m high within {EDGE_MARGIN} m of an edge; the landing surface is {surface:.2f} m high"
            )
