"""``aerial plan``: one plan and its figures."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from aerial_evaluation.judgement.verification import Verification, verify
from aerial_model.errors import RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.plan_file import save_plan
from aerial_operator.console import Report, pairs, percent, say
from aerial_operator.options.goal import add_goal_arguments, request_from
from aerial_operator.options.planning import add_planner_arguments, planner_choices, warm_planner
from aerial_planner.report import PlanReport

_STARTS = {"library": "library", "srbm": "warm", "reference": "cold"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add goal, planner options and where to save the plan."""
    add_goal_arguments(parser)
    add_planner_arguments(parser)
    parser.add_argument(
        "--verify", action="store_true", help="let MuJoCo fly the plan; it fails 3° or 3 cm off the goal"
    )
    parser.add_argument(
        "--out", metavar="FILE", type=Path, help="save the plan (.npz, see aerial_model.values.plan_file)"
    )


def run(args: argparse.Namespace) -> Report:
    """Plan on a warm planner: the building of its problems, once per process, is not counted."""
    robot = Robot.load(args.robot)
    request = request_from(args, robot, **planner_choices(args))
    planner = warm_planner(args, robot, request)
    try:
        result = planner.plan(request)
    except RefusalError as refusal:
        say(f"refused: {refusal.reason}")
        return Report(success=False, figures=refusal.report.to_json(), text=_times(refusal.report))
    if args.out is not None:
        save_plan(result.plan, args.out)
    figures, text = result.report.to_json(), summary(result.report)
    if not args.verify:
        return Report(success=True, figures=figures, text=text)
    verification = verify(robot, result.plan)
    figures["verification"] = verification.to_json()
    return Report(success=verification.passed, figures=figures, text=f"{text}\n{_verdict(verification)}")


def summary(report: PlanReport) -> str:
    """Return the figures of a plan for a person."""
    landing = ", ".join(f"{x:z.2f}" for x in report.landing_position_m)
    rotation = ", ".join(str(round(x)) for x in report.rotation_deg)
    return "\n".join(
        [
            _times(report),
            pairs(
                [
                    ("take-off, flight", f"{report.take_off_time_s:.2f} s, {report.flight_time_s:.2f} s"),
                    ("landing at", f"{landing} m"),
                    ("rotation", f"{rotation}°"),
                    ("peak torque", f"{percent(report.peak_torque_ratio)} of the limit"),
                    ("peak voltage", f"{percent(report.peak_voltage_ratio)} of the limit"),
                    ("peak speed", f"{percent(report.peak_speed_ratio)} of the limit"),
                    ("worst violation", f"{report.max_violation:.1e}"),
                ]
            ),
        ]
    )


def _verdict(verification: Verification) -> str:
    verdict = "the plan holds" if verification.passed else "THE PLAN FAILS"
    return (
        f"flown by MuJoCo: {np.rad2deg(verification.attitude_error):.1f}° and "
        f"{100 * verification.position_error:.1f} cm off the goal; {verdict}"
    )


def _times(report: PlanReport) -> str:
    start = _STARTS.get(report.started_from, "no")
    outcome = "planned" if report.success else "refused"
    return (
        f"{report.motion} of {report.robot}, {report.variant}, {start} start, {report.solver}: {outcome} in "
        f"{report.total_time_s:.2f} s (single rigid body {report.srbm_time_s:.2f} s, "
        f"kino-dynamic {report.solve_time_s:.2f} s, {report.iterations} iterations)"
    )
