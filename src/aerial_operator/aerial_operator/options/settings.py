"""``--set SECTION.KEY=VALUE``: a robot with some numbers and choices of its ``robot.yaml`` replaced."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from typing import Any

import yaml

from aerial_model.robot.robot import Robot

EXAMPLE = "controller.weight_force=2.0"  # of an assignment, in messages


def setting(text: str) -> tuple[list[str], Any]:
    """Return path and value of ``SECTION.KEY[.KEY…]=VALUE``."""
    name, equals, value = text.partition("=")
    path = name.split(".")
    if not equals or len(path) < 2 or not all(path):
        raise argparse.ArgumentTypeError(f"expected SECTION.KEY=VALUE, such as {EXAMPLE}; found '{text}'")
    try:
        return path, yaml.safe_load(value)
    except yaml.YAMLError:
        raise argparse.ArgumentTypeError(f"'{value}' is no YAML value in '{text}'") from None


def add_setting_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--set``."""
    parser.add_argument(
        "--set",
        metavar="SECTION.KEY=VALUE",
        dest="settings",
        type=setting,
        action="append",
        default=[],
        help="replace a number or choice of robot.yaml: planner.…, controller.… or sensors.…; may be given again",
    )


def with_settings(robot: Robot, settings: Iterable[tuple[list[str], Any]]) -> Robot:
    """Return the robot with values replaced; what a section does not know is refused by the one that reads it.

    Raises:
        ConfigurationError: if there is no such section.
    """
    for (section, key, *path), value in settings:
        old = robot.sections.get(section, {}).get(key, {})
        robot = robot.with_section(section, **{key: _replaced(old, path, value)})
    return robot


def _replaced(old: Any, path: list[str], value: Any) -> Any:
    if not path:
        return value
    content = old if isinstance(old, Mapping) else {}
    return {**content, path[0]: _replaced(content.get(path[0], {}), path[1:], value)}
