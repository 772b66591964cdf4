"""``aerial compile``: the planner's functions as machine code, so that plans take a third of the time."""

from __future__ import annotations

import argparse
import time

from aerial_model.robot.robot import Robot
from aerial_operator.console import Report
from aerial_operator.options.planning import compile_functions
from aerial_planner.codegen.library import default_cache
from aerial_planner.motion.motion import known_motions


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
    began = time.perf_counter()
    compiled = compile_functions(robot, known_motions(robot), args.variant or ["AAKD*"])
    seconds, folder = time.perf_counter() - began, str(default_cache())
    figures = {"robot": robot.name, "compiled": compiled, "seconds": seconds, "folder": folder}
    return Report(success=True, figures=figures, text=f"{compiled} libraries compiled in {seconds:.0f} s, in {folder}")
