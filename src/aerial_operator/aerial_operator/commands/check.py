"""``aerial check``: is a robot folder, or a URDF, complete and plausible?"""

from __future__ import annotations

import argparse

from aerial_evaluation.robot_check import ERROR, check
from aerial_operator.console import Report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to check."""
    parser.add_argument("path", metavar="FOLDER_OR_URDF", nargs="?", help="(default: the robot of --robot)")


def run(args: argparse.Namespace) -> Report:
    """Print every finding; it fails if one is an error."""
    findings = check(args.path or args.robot)
    errors = sum(finding.level == ERROR for finding in findings)
    lines = [f"{finding.level:8}{finding.text}" for finding in findings]
    lines.append("nothing keeps it from jumping" if not errors else f"{errors} to mend")
    figures = {"success": not errors, "findings": [{"level": f.level, "text": f.text} for f in findings]}
    return Report(success=not errors, figures=figures, text="\n".join(lines))
