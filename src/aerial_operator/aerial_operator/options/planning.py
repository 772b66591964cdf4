"""The planner that the options ask for."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from aerial_model.errors import RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_operator.console import say
from aerial_planner.assembly.library import PlanLibrary
from aerial_planner.codegen.library import default_cache
from aerial_planner.motion.motion import load_motion
from aerial_planner.ocp.options import SolverName
from aerial_planner.planner import Planner


def add_choice_arguments(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """Add what a request may choose of the planner, and return the group these options are in."""
    planner = parser.add_argument_group("planner")
    planner.add_argument("--variant", metavar="KD|AAKD|AAKD*", default="AAKD*", help="of its dynamics (default: AAKD*)")
    planner.add_argument("--no-warm-start", action="store_true", help="skip the single-rigid-body stage")
    planner.add_argument(
        "--optimize-timing", action="store_true", help="let the optimizer choose how long the take-off's phases last"
    )
    return planner


def add_planner_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what a request may choose of the planner, and what makes a planner of this process: its solver, its plans."""
    planner = add_choice_arguments(parser)
    planner.add_argument(
        "--library",
        metavar="FOLDER",
        type=Path,
        help="start from the nearest plan in it, if one is near; add the new one",
    )
    planner.add_argument(
        "--solver",
        choices=[solver.value for solver in SolverName],
        default=SolverName.RICCATI.value,
        help="(default: %(default)s)",
    )


def planner_choices(args: argparse.Namespace) -> dict[str, Any]:
    """Return the fields of a request that ``add_choice_arguments`` sets."""
    return {
        "variant": args.variant,
        "warm_start": not args.no_warm_start,
        "optimize_timing": args.optimize_timing,
    }


def warm_planner(args: argparse.Namespace, robot: Robot, request: MotionRequest) -> Planner:
    """Return a planner whose problems are built: what a user waits for a plan is what a running planner takes."""
    plans = PlanLibrary(args.library, robot, say) if args.library is not None else None
    planner = Planner(robot, solver=args.solver, cache=default_cache(), plans=plans)
    with contextlib.suppress(RefusalError):  # the plan will raise it again, with its figures
        planner.warm_up(request)
    return planner


def compile_functions(robot: Robot, motions: Iterable[str], variants: Iterable[str]) -> int:
    """Compile what plans of these motions and variants evaluate, both senses of turning; return how much was missing."""
    requests = [
        MotionRequest(motion=motion, rotation=turns, variant=variant)
        for variant in variants
        for motion in motions
        for turns in _senses(motion, robot)
    ]
    return Planner(robot, cache=default_cache()).compile(requests, lambda kind: say(f"compiling {kind}"))


def _senses(motion: str, robot: Robot) -> list[float | None]:
    """Return what to ask of a motion so that all its contact schedules occur; None: as the motion says."""
    wanted = load_motion(motion, robot)
    if wanted.rotation is None or "rotation" not in wanted.goal:
        return [None]
    return [wanted.rotation.turns, -wanted.rotation.turns]
