"""Messages from and to the model's types: conversions are here, once, and explicit; those of the control loop in ``wire``.

rclpy does not check fields unless it is told to, and a wrong type becomes garbage on the wire: numbers are made
Python's own, arrays ``array('d')`` or NumPy's float64.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

from aerial_model.errors import ConfigurationError, InvalidPlanError, RefusalCode, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.estimate import Estimate
from aerial_model.values.plan import Ending, Plan
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import BOXES_MAX, Box, Terrain
from aerial_msgs.msg import MotionPlan, MotionResult, MotionSelection, TerrainBox

NANO = 1_000_000_000

# Fields of a plan that have the same name and meaning in its message.
_PLAN_TEXTS = ("request_id", "motion", "robot", "model_hash")
_PLAN_ROWS = ("q", "v", "com", "com_velocity", "angular_momentum")
_PLAN_CONTACT_ROWS = ("foot_position", "force")
_PLAN_NUMBERS = ("take_off_time", "landing_time", "landing_com_height", "landing_yaw")
_PLAN_VECTORS = ("landing_support_centre", "rotation")

_ENDINGS = {getattr(MotionPlan, ending.name): ending for ending in Ending}
_CODES = {getattr(MotionResult, code.name): code for code in RefusalCode}
_OUTCOMES = {
    getattr(MotionResult, name): name.lower()
    for name in ("PLANNED", "REFUSED", "STARTED", "LANDED", "FAILED", "ABORTED")
}


def seconds_and_nanoseconds(time: float) -> tuple[int, int]:
    """Return a time [s] in whole seconds and nanoseconds, rounded; exact for the calendar's 1.8e9 s as well."""
    seconds = math.floor(time)
    carry, nanoseconds = divmod(round((time - seconds) * NANO), NANO)
    return seconds + carry, nanoseconds


def to_stamp(time: float) -> Time:
    """Return a time [s] as a stamp, rounded to the nanosecond."""
    seconds, nanoseconds = seconds_and_nanoseconds(time)
    return Time(sec=seconds, nanosec=nanoseconds)


def from_stamp(stamp: Time) -> float:
    """Return a stamp as a time [s]."""
    return stamp.sec + stamp.nanosec / NANO


def doubles(values: np.ndarray) -> array:
    """Return numbers as the content of a ``float64[]`` field, row-major."""
    return array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


# --- requests --------------------------------------------------------------------------------------------------------


def terrain_to_message(terrain: Terrain) -> list[TerrainBox]:
    """Return the boxes of a terrain."""
    return [
        TerrainBox(centre=np.array(box.centre), size=np.array(box.size), yaw=float(box.yaw)) for box in terrain.boxes
    ]


def terrain_from_message(boxes: Sequence[TerrainBox], base: float = 0.0) -> Terrain:
    """Return the terrain that boxes on a floor at height ``base`` [m] make.

    Raises:
        ConfigurationError: if there are too many boxes, or one is not finite, without extent or absurdly large or far.
    """
    if len(boxes) > BOXES_MAX:  # before anything is built of them
        raise ConfigurationError(f"expected at most {BOXES_MAX} boxes, found {len(boxes)}")
    try:
        return Terrain(boxes=tuple(_box_from_message(box, i) for i, box in enumerate(boxes)), base=base)
    except ValueError as error:
        raise ConfigurationError(str(error)) from None


def _box_from_message(box: TerrainBox, index: int) -> Box:
    try:
        return Box(centre=np.array(box.centre), size=np.array(box.size), yaw=box.yaw)
    except (ConfigurationError, ValueError) as error:
        raise ConfigurationError(f"box {index}: {error}") from None


def selection_to_message(request: MotionRequest) -> MotionSelection:
    """Return the selection that asks for ``request``."""
    return MotionSelection(
        request_id=request.request_id,
        motion=request.motion,
        displacement=np.array(request.displacement),
        yaw=float(request.yaw),
        has_rotation=request.rotation is not None,
        rotation=float(request.rotation or 0.0),
        variant=request.variant,
        no_warm_start=not request.warm_start,
        optimize_timing=request.optimize_timing,
        terrain=terrain_to_message(request.terrain),
    )


def selection_from_message(message: MotionSelection) -> MotionRequest:
    """Return what a selection asks for.

    Raises:
        RefusalError: if a number is not finite, or the terrain is none.
    """
    options = {"variant": message.variant} if message.variant else {}
    try:
        return MotionRequest(
            request_id=message.request_id,
            motion=message.motion,
            displacement=np.array(message.displacement),
            yaw=message.yaw,
            rotation=message.rotation if message.has_rotation else None,
            terrain=terrain_from_message(message.terrain),
            warm_start=not message.no_warm_start,
            optimize_timing=message.optimize_timing,
            **options,
        )
    except (ConfigurationError, ValueError) as error:
        raise RefusalError(RefusalCode.INVALID_REQUEST, f"the selection makes no sense: {error}") from None


# --- answers ---------------------------------------------------------------------------------------------------------


def code_to_message(code: RefusalCode) -> int:
    """Return the constant of ``MotionResult`` that mirrors a refusal code."""
    return int(getattr(MotionResult, code.name))


def code_from_message(message: MotionResult) -> RefusalCode | None:
    """Return the refusal code of an answer; None if it has none."""
    return _CODES.get(message.code)


def outcome_from_message(message: MotionResult) -> str:
    """Return the outcome an answer tells, as a word."""
    return _OUTCOMES.get(message.outcome, f"outcome {message.outcome}")


def result_to_message(
    request_id: str, motion: str, outcome: int, stamp: Time, refusal: RefusalError | None = None
) -> MotionResult:
    """Return an answer to a selection; ``refusal`` is why, for an outcome that needs a reason."""
    return MotionResult(
        stamp=stamp,
        request_id=request_id,
        motion=motion,
        outcome=outcome,
        code=MotionResult.NONE if refusal is None else code_to_message(refusal.code),
        reason="" if refusal is None else refusal.reason,
    )


# --- plans -----------------------------------------------------------------------------------------------------------


def plan_to_message(plan: Plan, robot: Robot) -> MotionPlan:
    """Return the message that carries a plan."""
    return MotionPlan(
        joint_names=list(robot.joint_names),
        contact_names=[point.name for point in robot.contact_points],
        contact=plan.contact.ravel().tolist(),
        landing_joint_position=doubles(plan.landing_joint_position),
        terrain=terrain_to_message(plan.terrain),
        ending=getattr(MotionPlan, plan.ending.name),
        **{name: getattr(plan, name) for name in _PLAN_TEXTS},
        **{name: doubles(getattr(plan, name)) for name in ("time", *_PLAN_ROWS, *_PLAN_CONTACT_ROWS)},
        **{name: float(getattr(plan, name)) for name in _PLAN_NUMBERS},
        **{name: np.array(getattr(plan, name), dtype=np.float64) for name in _PLAN_VECTORS},
    )


def plan_from_message(message: MotionPlan, robot: Robot) -> Plan:
    """Return the plan a message carries, checked to be for ``robot``, consistent and finite.

    Raises:
        InvalidPlanError: naming the field, what was expected and what was found.
    """
    joints = list(message.joint_names)
    if message.model_hash == robot.model_hash and joints != list(robot.joint_names):
        raise InvalidPlanError(
            f"plan field joint_names: expected {', '.join(robot.joint_names)}, found {', '.join(joints)}"
        )
    try:
        terrain = terrain_from_message(message.terrain)
    except ConfigurationError as error:
        raise InvalidPlanError(f"plan field terrain: {error}") from None
    if message.ending not in _ENDINGS:
        known = ", ".join(f"{number} ({ending})" for number, ending in _ENDINGS.items())
        raise InvalidPlanError(f"plan field ending: unknown ending {message.ending}; known: {known}")
    plan = Plan(
        contact=_rows(message, "contact", -1).astype(bool),
        landing_joint_position=np.array(message.landing_joint_position),
        terrain=terrain,
        ending=_ENDINGS[message.ending],
        time=_rows(message, "time"),
        **{name: _rows(message, name, -1) for name in _PLAN_ROWS},
        **{name: _rows(message, name, -1, 3) for name in _PLAN_CONTACT_ROWS},
        **{name: getattr(message, name) for name in (*_PLAN_TEXTS, *_PLAN_NUMBERS)},
        **{name: np.array(getattr(message, name)) for name in _PLAN_VECTORS},
    )
    return plan.checked(robot)


def _rows(message: MotionPlan, name: str, *shape: int) -> np.ndarray:
    """Return a field with one row of ``shape`` a knot; -1 in it takes what there is."""
    values, knots = np.array(getattr(message, name)), len(message.time)
    try:
        return values.reshape(knots, *shape)
    except ValueError:
        raise InvalidPlanError(f"plan field {name}: {values.size} values do not fit {knots} times") from None


# --- state -----------------------------------------------------------------------------------------------------------


def estimate_from_messages(odometry: Odometry, joints: JointState, robot: Robot) -> Estimate | None:
    """Return where the robot is believed to be; None if a joint is missing or a number is not finite."""
    index = {name: k for k, name in enumerate(joints.name)}
    if any(name not in index for name in robot.joint_names) or len(joints.velocity) < len(index):
        return None
    order = [index[name] for name in robot.joint_names]
    position, orientation = odometry.pose.pose.position, odometry.pose.pose.orientation
    linear, angular = odometry.twist.twist.linear, odometry.twist.twist.angular
    base = [position.x, position.y, position.z, orientation.x, orientation.y, orientation.z, orientation.w]
    twist = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
    q = np.concatenate([base, np.array(joints.position)[order]])
    v = np.concatenate([twist, np.array(joints.velocity)[order]])
    if not (np.all(np.isfinite(q)) and np.all(np.isfinite(v))):
        return None
    return Estimate(time=from_stamp(odometry.header.stamp), q=q, v=v)
