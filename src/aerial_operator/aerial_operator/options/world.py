"""``--world`` and ``--vary``: a world that is not as planner and controller believe."""

from __future__ import annotations

import argparse
import dataclasses

from aerial_evaluation.campaign.variation import Variation
from aerial_model.config import closest
from aerial_model.errors import ConfigurationError
from aerial_operator.console import UsageError
from aerial_operator.options.goal import finite
from aerial_sim.conditions import Conditions


def add_world_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--world``."""
    known = ", ".join(Conditions.names())
    parser.add_argument(
        "--world",
        metavar="KEY=VALUE",
        type=_pair,
        action="append",
        default=[],
        help=f"what the world is really like: {known}; may be given again",
    )


def add_vary_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--vary``."""
    parser.add_argument(
        "--vary",
        metavar="KEY=LO:HI[:STEPS]",
        type=_variation,
        action="append",
        default=[],
        help="draw a condition of the world anew for each trial, or go through it in steps, with all seeds at each",
    )


def conditions_from(args: argparse.Namespace) -> Conditions:
    """Return the world that ``--world`` asks for.

    Raises:
        UsageError: if a name or value makes no sense.
    """
    for name, _ in args.world:
        if name not in Conditions.names():
            known = Conditions.names()
            raise UsageError(f"no condition '{name}'{closest(name, known)}; there are {', '.join(known)}")
    try:
        return dataclasses.replace(Conditions(), **dict(args.world))
    except ValueError as error:
        raise UsageError(str(error)) from None


def _pair(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name, finite(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected KEY=VALUE, such as friction=0.5; found '{text}'") from None


def _variation(text: str) -> Variation:
    name, _, bounds = text.partition("=")
    low, _, rest = bounds.partition(":")
    high, colon, steps = rest.partition(":")
    try:
        return Variation(name=name, low=finite(low), high=finite(high), steps=int(steps) if colon else None)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"expected KEY=LO:HI or KEY=LO:HI:STEPS, such as friction=0.4:1.0:7; found '{text}'"
        ) from None
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
