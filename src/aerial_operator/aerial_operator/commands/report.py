"""``aerial report``: the verdict on every motion in a recording."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aerial_model.robot.robot import Robot
from aerial_operator.console import Report, percent, table
from aerial_operator.recording.recording import Recording
from aerial_operator.recording.verdict import RecordedMotion, motions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recording."""
    parser.add_argument("recording", metavar="RECORDING", type=Path, help="a folder, such as out/demo/recording")


def run(args: argparse.Namespace) -> Report:
    """Judge every motion by ground truth; it succeeds if all landed."""
    robot = Robot.load(args.robot)
    found = motions(robot, Recording.read(args.recording))
    landed = bool(found) and all(motion.landed for motion in found)
    figures = {
        "landed": landed,
        "robot": robot.name,
        "recording": str(args.recording),
        "motions": [motion.to_json() for motion in found],
    }
    return Report(success=landed, figures=figures, text=_text(found))


def _text(found: Sequence[RecordedMotion]) -> str:
    if not found:
        return "no motion was asked for while this was recorded"
    header = ("request", "motion", "landed", "at", "tilt", "rotation off by", "peak torque", "peak voltage")
    return table(header, [_row(motion) for motion in found])


def _row(motion: RecordedMotion) -> list[str]:
    name = [motion.request_id, motion.motion]
    if motion.verdict is None:
        return [*name, f"no, {motion.outcome or 'never answered'}: {motion.reason or 'it never began'}", *["–"] * 5]
    landing = motion.verdict.landing
    return [
        *name,
        "yes" if landing.landed else f"no: not {', '.join(landing.failed)}",
        ", ".join(f"{x:z.2f}" for x in motion.verdict.run.displacement) + " m",
        f"{np.degrees(landing.tilt):.1f}°",
        f"{np.degrees(landing.rotation_error):.1f}°",
        percent(landing.peak_torque_ratio),
        percent(landing.peak_voltage_ratio),
    ]
