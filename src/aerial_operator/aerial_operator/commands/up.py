"""``aerial up``: the three nodes, until Ctrl-C."""

from __future__ import annotations

import argparse
from pathlib import Path

from aerial_model.robot.robot import Robot
from aerial_operator.client import connected
from aerial_operator.console import Report, say
from aerial_operator.processes import PLANNER, NodeProcesses, parameters

_WATCH_PERIOD = 0.5  # between two looks at the processes [s]
_PATIENCE = 20.0  # after which a person is told what is missing [s]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the nodes may be told."""
    parser.add_argument("--noise", choices=("nominal", "off"), default="nominal", help="(default: nominal)")
    parser.add_argument(
        "--library", metavar="FOLDER", type=Path, help="of plans that the planner starts from and adds to"
    )
    parser.add_argument("--lock-step", action="store_true", help="as fast as possible instead of in real time")


def run(args: argparse.Namespace) -> Report:
    """Start the nodes, say when they are ready, watch them until told to stop."""
    Robot.load(args.robot)  # a robot that does not load is one sentence here, and three logs there
    told = parameters(args.robot, seed=args.seed, noise=args.noise, real_time=not args.lock_step)
    if args.library is not None:
        told[PLANNER.name]["library"] = str(args.library.expanduser().resolve())
    ready, died = False, []
    with NodeProcesses(told) as nodes, connected() as client:
        say("starting simulator, controller and planner; Ctrl-C ends them")
        patience = round(_PATIENCE / _WATCH_PERIOD)
        try:
            while nodes.alive:
                client.wait(lambda: False, _WATCH_PERIOD)
                patience -= 1
                if not ready and not client.missing:
                    ready = True
                    say("ready. In another terminal: ./aerial select jump --to 0.3,0,0")
                    if not client.warm:
                        say("the planner is still warming up: the first plans may take some seconds")
                if not ready and patience == 0:
                    say(f"not ready yet: {'; '.join(client.missing)}")
                for program, sentence in nodes.newly_dead():
                    died.append(program.name)
                    say(sentence)
        except KeyboardInterrupt:
            say("ending the nodes")
    success = ready and not died
    return Report(success=success, figures={"success": success, "ready": ready, "died": died}, text="")
