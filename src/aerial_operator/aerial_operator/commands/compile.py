"""``aerial compile``: the planner's functions as machine code, so that plans take half the time."""

from __future__ import annotations

import argparse
import time

from aerial_model.request import MotionRequest
from aerial_model.robot import Robot
from aerial_operator.console import Report, say
from aerial_planner.compiled import default_cache
from aerial_planner.planner import Planner
from aerial_planner.schedule import known_motions, load_motion


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choice of variants."""
    parser.add_argument(
        "--variant",
        metavar="KD|AAKD|AAKD*",
        action="append",
        help="compile for this one; may be given more than once (default: AAKD*)",
    )


def run(args: argparse.Namespace) -> Report:
    """Compile what is not compiled yet, for all motions, both senses of turning."""
    robot = Robot.load(args.robot)
    cache = default_cache()
    began = time.perf_counter()
    requests = [
        MotionRequest(motion=motion, rotation=turns, variant=variant)
        for variant in args.variant or ["AAKD*"]
        for motion in known_motions()
        for turns in _senses(motion)
    ]
    compiled = Planner(robot, cache=cache).compile(requests, lambda kind: say(f"compiling {kind}"))
    seconds = time.perf_counter() - began
    figures = {"robot": robot.name, "compiled": compiled, "seconds": seconds, "folder": str(cache)}
    return Report(success=True, figures=figures, text=f"{compiled} stage kinds compiled in {seconds:.0f} s, in {cache}")


def _senses(motion: str) -> list[float | None]:
    """Return what to ask of a motion so that all its contact schedules occur; None: as the motion says."""
    wanted = load_motion(motion)
    if wanted.rotation is None or "rotation" not in wanted.goal:
        return [None]
    return [wanted.rotation.turns, -wanted.rotation.turns]
