"""``aerial simulate``: one motion in closed loop, in one process, and the verdict on it."""

from __future__ import annotations

import argparse
from pathlib import Path

from aerial_evaluation.closed_loop import Outcome
from aerial_evaluation.closed_loop import run as run_closed_loop
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
        outcome = run_closed_loop(
            robot, request, seed=args.seed, noise=args.noise, conditions=conditions_from(args), planner=planner
        )
    except RefusalError as refusal:
        say(f"refused: {refusal.reason}")
        return Report(success=False, figures=_refused(refusal, args.seed), text=f"{args.motion}: refused")
    if args.picture is not None:
        save_picture(robot, outcome.planning.plan, outcome.terrain, outcome.ticks, outcome.start_time, args.picture)
    return Report(success=outcome.landing.landed, figures=outcome.to_json(), text=_summary(outcome))


def _refused(refusal: RefusalError, seed: int) -> dict[str, object]:
    plan = None if refusal.report is None else refusal.report.to_json()
    reason = {"code": refusal.code.value, "reason": refusal.reason}
    return {"landed": False, "checks": {}, "plan": plan, "seed": seed, "refusal": reason}


def _summary(outcome: Outcome) -> str:
    landing, figures = outcome.landing, outcome.to_json()
    verdict = "landed" if landing.landed else f"not landed: {', '.join(landing.failed)}"
    tick = figures["tick_us"]
    return f"{outcome.planning.plan.motion} of {outcome.planning.plan.robot}, seed {outcome.seed}: {verdict}\n" + pairs(
        [
            ("planned in", f"{outcome.planning.report.total_time_s:.2f} s"),
            ("tilt at the end", f"{figures['tilt_deg']:.1f}°"),
            ("height at the end", f"{landing.height:.3f} m"),
            ("landing error", f"{100 * landing.position_error:.1f} cm, {figures['rotation_error_deg']:.1f}°"),
            ("apex", f"{landing.apex:.2f} m"),
            ("peak torque", f"{percent(landing.peak_torque_ratio)} of the limit"),
            ("peak voltage", f"{percent(landing.peak_voltage_ratio)} of the limit"),
            ("control tick", f"{tick['p50']:.0f} µs (99 %: {tick['p99']:.0f} µs)"),
            ("speed", f"{outcome.real_time_factor:.1f} × real time"),
        ]
    )
