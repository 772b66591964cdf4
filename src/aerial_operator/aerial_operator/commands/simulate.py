"""``aerial simulate``: one motion in closed loop, in one process, and the verdict on it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from aerial_evaluation.closed_loop import run as run_closed_loop
from aerial_evaluation.judgement import consistency, tracking
from aerial_evaluation.judgement.landing import Landing, judge
from aerial_evaluation.record import Run
from aerial_evaluation.statistics import MICRO
from aerial_model.errors import RefusalError
from aerial_model.robot.robot import Robot
from aerial_operator.console import Report, pairs, percent, say
from aerial_operator.options.goal import add_goal_arguments, request_from
from aerial_operator.options.planning import add_planner_arguments, planner_choices, warm_planner
from aerial_operator.options.settings import add_setting_argument, with_settings
from aerial_operator.options.world import add_world_argument, conditions_from
from aerial_operator.picture import save_picture


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add goal, planner, noise and settings."""
    add_goal_arguments(parser)
    add_planner_arguments(parser)
    parser.add_argument("--noise", choices=("nominal", "off"), default="nominal", help="(default: nominal)")
    parser.add_argument("--picture", metavar="FILE", type=Path, help="draw the motion into a PNG file")
    add_world_argument(parser)
    add_setting_argument(parser)


def run(args: argparse.Namespace) -> Report:
    """Plan, execute, judge."""
    robot = with_settings(Robot.load(args.robot), args.settings)
    request = request_from(args, robot, **planner_choices(args))
    planner = warm_planner(args, robot, request)
    try:
        record = run_closed_loop(
            robot, request, seed=args.seed, noise=args.noise, conditions=conditions_from(args), planner=planner
        )
    except RefusalError as refusal:
        say(f"refused: {refusal.reason}")
        return Report(success=False, figures=_refused(refusal, args.seed), text=f"{args.motion}: refused")
    if args.picture is not None:
        save_picture(record, args.picture)
    landing = judge(record)
    return Report(success=landing.landed, figures=_figures(record, landing), text=_summary(record, landing))


def _figures(record: Run, landing: Landing) -> dict[str, Any]:
    """Return what ``./aerial simulate --json`` prints."""
    timing, report = record.timing, record.report
    tick = None if timing is None else timing.tick
    estimate = consistency.summary([consistency.sampled(record)])
    tracked = tracking.summary([tracking.sampled(record)])
    return {
        **landing.to_json(),
        "tick_us": None if tick is None else tick.to_json(),
        "real_time_factor": None if timing is None else timing.real_time_factor,
        "cpu_factor": None if timing is None else timing.cpu_factor,
        "estimate": {phase: errors.to_json() for phase, errors in estimate.items()},
        "tracking": {phase: errors.to_json() for phase, errors in tracked.items()},
        "plan": None if report is None else report.to_json(),
        "motion": record.plan.motion,
        "robot": record.plan.robot,
        "noise": record.noise,
        "seed": record.seed,
    }


def _refused(refusal: RefusalError, seed: int) -> dict[str, object]:
    plan = None if refusal.report is None else refusal.report.to_json()
    reason = {"code": refusal.code.value, "reason": refusal.reason}
    return {"landed": False, "checks": {}, "plan": plan, "seed": seed, "refusal": reason}


def _summary(record: Run, landing: Landing) -> str:
    verdict = "landed" if landing.landed else f"not landed: {', '.join(landing.failed)}"
    rows = [
        ("tilt at the end", f"{np.degrees(landing.tilt):.1f}°"),
        ("height at the end", f"{landing.height:.3f} m"),
        ("landing error", f"{100 * landing.position_error:.1f} cm, {np.degrees(landing.rotation_error):.1f}°"),
        ("apex", f"{landing.apex:.2f} m"),
        ("peak torque", f"{percent(landing.peak_torque_ratio)} of the limit"),
        ("peak voltage", f"{percent(landing.peak_voltage_ratio)} of the limit"),
    ]
    if record.report is not None:
        rows.insert(0, ("planned in", f"{record.report.total_time_s:.2f} s"))
    if record.timing is not None and record.timing.tick is not None:
        tick = record.timing.tick
        rows.append(("control tick", f"{MICRO * tick.p50:.0f} µs (99 %: {MICRO * tick.p99:.0f} µs)"))
        rows.append(("speed", f"{record.timing.real_time_factor:.1f} × real time"))
    return f"{record.plan.motion} of {record.plan.robot}, seed {record.seed}: {verdict}\n" + pairs(rows)
