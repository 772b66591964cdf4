"""``aerial select``: one motion, asked of running nodes."""

from __future__ import annotations

import argparse

from aerial_model.robot.robot import Robot
from aerial_model.values.request import ControllerCommand
from aerial_operator.client import connected
from aerial_operator.console import Report, say
from aerial_operator.options.goal import add_goal_arguments, request_from
from aerial_operator.options.planning import add_choice_arguments, planner_choices


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the goal and what may be chosen of the planner."""
    add_goal_arguments(parser, more=f"; or for the controller alone: {', '.join(ControllerCommand)}")
    add_choice_arguments(parser)


def run(args: argparse.Namespace) -> Report:
    """Publish the selection and wait for its answers."""
    request = request_from(args, Robot.load(args.robot), **planner_choices(args))
    with connected() as client:
        request_id, answers = client.select(request, heard=lambda answer: say(str(answer)))
    last = answers[-1]
    return Report(
        success=last.outcome == "landed",
        figures={
            "success": last.outcome == "landed",
            "request_id": request_id,
            "motion": request.motion,
            "outcome": last.outcome,
            "answers": [answer.to_json() for answer in answers],
            "refusal": None if last.code is None else {"code": last.code.value, "reason": last.reason},
        },
        text=f"{request.motion}: {last.outcome}",
    )
