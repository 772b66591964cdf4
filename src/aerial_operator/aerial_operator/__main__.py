"""The ``aerial`` command line: finds the command, runs it, reports, and gives the exit status.

A command is a module in ``commands/`` with ``add_arguments(parser)`` and ``run(args) -> Report``; only the one asked
for is imported.
"""

from __future__ import annotations

import argparse
import importlib
import re
import signal
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from aerial_model import __version__
from aerial_model.config import closest
from aerial_model.errors import AerialError, RefusalCode, RefusalError
from aerial_operator.console import Report, UsageError, pairs, reserved_output, to_json

COMMANDS = {
    "demo": "jump forward, backward, to the left and onto a platform: three nodes in real time, then a table",
    "plan": "plan one motion and print its figures",
    "simulate": "plan one motion, then run it in closed loop in one process, and judge the landing",
    "campaign": "many seeded trials of one motion in parallel: the share that lands, and which seeds do not",
    "compile": "compile the planner's functions once, so that plans take a third of the time",
    "bench": "measure how fast and how reliably motions are planned, or how the control loop keeps up",
    "draft": "write a first robot.yaml for somebody's URDF, what was guessed marked as such",
    "check": "check a robot folder or a URDF: what is missing, what is implausible, what to do about it",
    "up": "start planner, controller and simulator, and keep them running",
    "select": "ask running nodes for one motion, and wait for what comes of it",
    "report": "judge every motion in a recording, such as the demo leaves, by ground truth",
}
BY_SHELL = {
    "test": "run the test suite",
    "run": "start one executable of one package, as `ros2 run` does: PACKAGE EXECUTABLE [arguments]",
}
USAGE_STATUS = 2
INTERRUPTED_STATUS = 130
_NEGATIVE = re.compile(r"-[\d.]")


class _Parser(argparse.ArgumentParser):
    """A parser whose errors keep to the contract of ``--json``."""

    json = False

    def error(self, message: str) -> NoReturn:
        if self.json:
            print(to_json({"success": False, "refusal": {"code": "usage", "reason": message}}))
        super().error(message)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    if arguments and arguments[0] in ("-h", "--help"):
        print(_overview())
        return 0
    if arguments == ["--version"]:
        print(f"aerial {__version__}")
        return 0
    parser = _Parser(prog="aerial", usage="aerial COMMAND [options]", add_help=False)
    parser.json = "--json" in arguments
    if not arguments:
        parser.error(f"which command? There are {', '.join([*COMMANDS, *BY_SHELL])}")
    name, *rest = arguments
    if name not in COMMANDS:
        parser.error(f"no command '{name}'{closest(name, COMMANDS)}; there are {', '.join([*COMMANDS, *BY_SHELL])}")
    return _run(name, rest)


def _run(name: str, arguments: list[str]) -> int:
    command = importlib.import_module(f"aerial_operator.commands.{name}")
    parser = _Parser(prog=f"aerial {name}", description=f"{COMMANDS[name]}.", allow_abbrev=False)
    parser.json = "--json" in arguments
    command.add_arguments(parser)
    _add_common_arguments(parser)
    args = parser.parse_args(join_negative_values(arguments))
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # either way of ending us lets a command clean up
    try:
        with reserved_output() as output:
            report = _report(command, args)
            print(to_json(report.figures) if args.json else report.text, file=output)
    except UsageError as error:
        parser.error(str(error))
    except KeyboardInterrupt:
        return INTERRUPTED_STATUS
    return 0 if report.success else 1


def _report(command: Any, args: argparse.Namespace) -> Report:
    try:
        return command.run(args)
    except UsageError:
        raise
    except AerialError as error:
        print(f"aerial: {error}", file=sys.stderr)
        code = error.code if isinstance(error, RefusalError) else RefusalCode.INVALID_REQUEST
        return Report(
            success=False, figures={"success": False, "refusal": {"code": code.value, "reason": str(error)}}, text=""
        )


def _add_common_arguments(parser: argparse.ArgumentParser) -> None:
    common = parser.add_argument_group("common to all commands")
    common.add_argument("--robot", metavar="NAME_OR_FOLDER", default="mini_cheetah", help="(default: mini_cheetah)")
    common.add_argument("--seed", metavar="N", type=int, default=0, help="of everything drawn by chance (default: 0)")
    common.add_argument("--json", action="store_true", help="standard output is one JSON object")


def join_negative_values(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with ``--to -0.2,0,0`` as ``--to=-0.2,0,0``: argparse would take the value for an option."""
    joined: list[str] = []
    for argument in arguments:
        if _NEGATIVE.match(argument) and joined and joined[-1].startswith("--") and "=" not in joined[-1]:
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined


def _overview() -> str:
    commands = pairs([*COMMANDS.items(), *BY_SHELL.items()])
    return f"usage: aerial COMMAND [options]\n\n{commands}\n\n`aerial COMMAND --help` lists the options of a command, `aerial --version` tells the version."


if __name__ == "__main__":
    sys.exit(main())
