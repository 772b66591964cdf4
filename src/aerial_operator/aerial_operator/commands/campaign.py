"""``aerial campaign``: many seeded trials of one motion in parallel, and what share of them lands."""

from __future__ import annotations

import argparse
import json
import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from aerial_evaluation.campaign.campaign import FIGURES, Campaign, TrialResult
from aerial_evaluation.campaign.figure import draw
from aerial_evaluation.campaign.summary import CampaignSummary, Failure, Step, summary
from aerial_evaluation.campaign.variation import trials
from aerial_evaluation.campaign.workers import results, workers
from aerial_evaluation.judgement.consistency import ERRORS, NORMALIZED, EstimateErrors
from aerial_evaluation.judgement.tracking import FIGURES as TRACKED
from aerial_evaluation.judgement.tracking import TrackingErrors
from aerial_evaluation.statistics import Distribution
from aerial_model.robot.robot import Robot
from aerial_operator.console import ProgressBar, Report, UsageError, pairs, say, table, to_json
from aerial_operator.options.goal import add_goal_arguments, request_from
from aerial_operator.options.planning import add_planner_arguments, planner_choices
from aerial_operator.options.settings import add_setting_argument, with_settings
from aerial_operator.options.world import add_vary_argument, add_world_argument, conditions_from

FAILURES_SHOWN = 10
_PASSED_ON = {  # what a trial alone must be told, and what it takes to be so
    "robot": "mini_cheetah",
    "yaw": 0.0,
    "rotation": None,
    "platform": None,
    "hurdle": None,
    "gap": None,
    "edge": None,
    "variant": "AAKD*",
    "solver": "riccati",
    "noise": "nominal",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add goal, planner, world, and how many trials run where."""
    add_goal_arguments(parser)
    add_planner_arguments(parser)
    parser.add_argument("--trials", metavar="N", type=int, default=20, help="with seeds from --seed on (default: 20)")
    parser.add_argument("--noise", choices=("nominal", "off"), default="nominal", help="(default: nominal)")
    add_world_argument(parser)
    add_vary_argument(parser)
    add_setting_argument(parser)
    parser.add_argument(
        "--workers", metavar="N", type=int, default=os.cpu_count(), help="processes (default: one per processor)"
    )
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster to run on instead")
    parser.add_argument(
        "--out", metavar="FOLDER", type=Path, help="for results and figure (default: out/campaign/MOTION)"
    )


def run(args: argparse.Namespace) -> Report:
    """Run all trials; what is done is in the results file at any time."""
    if args.workers < 1:
        raise UsageError(f"--workers: expected at least 1, found {args.workers}")
    if args.library is not None:
        raise UsageError("--library: trials that learn from one another would not be repeatable alone")
    robot = with_settings(Robot.load(args.robot), args.settings)
    request = request_from(args, robot, **planner_choices(args))
    campaign = Campaign(robot=robot, request=request, noise=args.noise, solver=args.solver)
    todo = trials(args.trials, args.seed, args.vary, conditions_from(args))
    folder = args.out or Path("out/campaign") / args.motion
    folder.mkdir(parents=True, exist_ok=True)
    done: list[TrialResult] = []
    bar = ProgressBar(len(todo))
    with (folder / "trials.jsonl").open("w") as file, workers(args.workers, args.scheduler) as client:
        for result in results(campaign, todo, client):
            done.append(result)
            print(json.dumps(result.to_json()), file=file, flush=True)
            bar.show(len(done), f"{sum(r.landed for r in done)} landed")
    found = summary(done, args.vary)
    commands = [_command(args, failure) for failure in found.failures]
    figures = _figures(args, robot, found, commands, folder)
    title = f"{args.motion} of {robot.name}: {found.all.share.succeeded} of {found.all.share.trials} landed"
    draw(title, done, found.steps, folder / "campaign.png")
    (folder / "campaign.json").write_text(to_json(figures) + "\n")
    say(f"results are in {folder}")
    return Report(success=True, figures=figures, text=_text(title, found, commands))


def _figures(
    args: argparse.Namespace, robot: Robot, found: CampaignSummary, commands: Sequence[str], folder: Path
) -> dict[str, Any]:
    """Return what ``./aerial campaign --json`` prints."""
    figures = {
        "motion": args.motion,
        "robot": robot.name,
        "noise": args.noise,
        "seed": args.seed,
        **found.to_json(),
        "figure": str(folder / "campaign.png"),
        "results": str(folder / "trials.jsonl"),
    }
    for failure, command in zip(figures["failures"], commands, strict=True):
        failure["command"] = command
    return figures


def _command(args: argparse.Namespace, failure: Failure) -> str:
    """Return the command line that runs a failed trial alone and draws it."""
    words = ["./aerial", "simulate", args.motion, "--to", ",".join(f"{number:g}" for number in args.to)]
    for name, usual in _PASSED_ON.items():
        value = getattr(args, name)
        if value != usual:
            words += [f"--{name.replace('_', '-')}", f"{value:g}" if isinstance(value, float) else str(value)]
    words += [f"--{name.replace('_', '-')}" for name in ("no_warm_start", "optimize_timing") if getattr(args, name)]
    for path, value in args.settings:
        words += ["--set", f"{'.'.join(path)}={value}"]
    for name, value in failure.conditions.items():
        words += ["--world", f"{name}={value!r}"]
    return shlex.join([*words, "--seed", str(failure.seed), "--picture", "trial.png"])


def _text(title: str, found: CampaignSummary, commands: Sequence[str]) -> str:
    low, high = found.all.share.interval
    parts = [f"{title} (with 95 % confidence {100 * low:.1f} to {100 * high:.1f} %)"]
    if found.steps:
        header = [found.steps[0].name, "landed", *(f"median {figure}" for figure in FIGURES)]
        parts.append(table(header, [_step_row(step) for step in found.steps]))
    if found.all.figures:
        rows = [
            [name, *(f"{value:.3g}" for value in (spread.p50, spread.p95, spread.max))]
            for name, spread in found.all.figures.items()
        ]
        parts.append(table(["of those that landed", "median", "95 %", "largest"], rows))
    if found.tracking:
        parts.append(_tracking(found.tracking))
    if found.estimate:
        parts.append(_estimate(found.estimate))
    if found.failures:
        shown = [(failure.reason, command) for failure, command in zip(found.failures, commands, strict=True)]
        rest = len(shown) - FAILURES_SHOWN
        parts.append(
            "not landed, and how to see it:\n"
            + pairs(shown[:FAILURES_SHOWN])
            + (f"\n  … and {rest} more" if rest > 0 else "")
        )
    return "\n\n".join(parts)


def _step_row(step: Step) -> list[str]:
    share, figures = step.group.share, step.group.figures
    medians = [f"{figures[name].p50:.3g}" if name in figures else "–" for name in FIGURES]
    return [f"{step.value:g}", f"{share.succeeded} of {share.trials}", *medians]


def _tracking(phases: Mapping[str, TrackingErrors]) -> str:
    header = ["off the plan in", *(f"{name} (95 %)" for name in TRACKED)]
    rows = [[phase, *(_error(errors.figures[name]) for name in TRACKED)] for phase, errors in phases.items()]
    return table(header, rows)


def _estimate(phases: Mapping[str, EstimateErrors]) -> str:
    header = ["estimate in", *(f"{name} (95 %)" for name in ERRORS), *NORMALIZED, "if consistent"]
    rows = [
        [
            phase,
            *(_error(found.errors[name]) for name in ERRORS),
            *(f"{found.normalized[name]:.2f}" for name in NORMALIZED),
            "{:.2f} … {:.2f}".format(*found.interval),
        ]
        for phase, found in phases.items()
    ]
    return table(header, rows)


def _error(distribution: Distribution) -> str:
    return f"{distribution.rms:.3g} ({distribution.p95:.3g})"
