"""The options that say which motion is asked for, and the request they make: the same for every command."""

from __future__ import annotations

import argparse

import numpy as np

from aerial_model.errors import ConfigurationError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_operator.console import UsageError


def displacement(text: str) -> tuple[float, ...]:
    """Return the two or three numbers of ``X,Y[,Z]``."""
    try:
        numbers = tuple(finite(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) not in (2, 3):
        raise argparse.ArgumentTypeError(f"expected X,Y or X,Y,Z in metres, such as 0.3,0,0; found '{text}'")
    return numbers


def finite(text: str) -> float:
    """Return a finite number."""
    number = float(text)
    if not np.isfinite(number):
        raise ValueError
    return number


finite.__name__ = "number"  # argparse names the type in its message


def add_goal_arguments(parser: argparse.ArgumentParser, more: str = "") -> None:
    """Add MOTION, its goal and its terrain; ``more`` is said about MOTION."""
    parser.add_argument("motion", metavar="MOTION", help=f"jump, or another file name in the planner's motions/{more}")
    goal = parser.add_argument_group("goal, from where the robot stands: x ahead, y to the left, z up")
    goal.add_argument(
        "--to", metavar="X,Y[,Z]", type=displacement, default=(0.0, 0.0), help="landing place [m]; Z: its height"
    )
    goal.add_argument("--yaw", metavar="RAD", type=finite, default=0.0, help="change of heading at landing [rad]")
    goal.add_argument("--rotation", metavar="TURNS", type=finite, help="signed turns about the motion's own axis")
    terrain = parser.add_argument_group("terrain, along the jump; a landing height other than 0 implies its platform")
    kind = terrain.add_mutually_exclusive_group()
    kind.add_argument("--platform", metavar="H", type=finite, help="box to jump onto, H high [m]; or off, if negative")
    kind.add_argument("--hurdle", metavar="H", type=finite, help="thin bar to jump over, H high [m]")
    kind.add_argument("--gap", metavar="W", type=finite, help="trench to jump across, W wide [m]")
    terrain.add_argument("--edge", metavar="D", type=finite, help="its near edge is D ahead [m] (default: as feet fit)")


def request_from(args: argparse.Namespace, robot: Robot, **fields: object) -> MotionRequest:
    """Return the request that the options make; ``fields`` are further ones of it.

    Raises:
        UsageError: if the options contradict each other.
    """
    try:
        return _request(args, robot, fields)
    except (ConfigurationError, ValueError) as error:
        raise UsageError(str(error)) from None


def _request(args: argparse.Namespace, robot: Robot, fields: dict[str, object]) -> MotionRequest:
    landing_height = args.to[2] if len(args.to) == 3 else args.platform or 0.0
    request = MotionRequest(
        motion=args.motion,
        displacement=np.array([*args.to[:2], landing_height]),
        yaw=args.yaw,
        rotation=args.rotation,
        **fields,
    )
    if args.hurdle is not None:
        return request.with_hurdle(robot, args.hurdle, args.edge)
    if args.gap is not None:
        return request.with_gap(robot, args.gap, args.edge)
    if args.platform is not None or landing_height != 0:
        return request.with_platform(robot, args.platform, args.edge)
    if args.edge is not None:
        raise UsageError("--edge is that of a platform, hurdle or gap: none is asked for")
    return request
