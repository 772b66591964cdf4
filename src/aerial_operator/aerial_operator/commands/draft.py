"""``aerial draft``: a first ``robot.yaml`` for somebody's URDF."""

from __future__ import annotations

import argparse
from pathlib import Path

from aerial_model.errors import ConfigurationError
from aerial_model.robot.draft.draft import draft
from aerial_model.robot.loading import YAML_NAME
from aerial_model.robot.urdf import resolved
from aerial_operator.console import Report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the URDF, where to write, and what not to move."""
    parser.add_argument("urdf", metavar="URDF", help="a file, or package://NAME/PATH")
    parser.add_argument("--out", metavar="FOLDER", type=Path, help="to make (default: the URDF's name)")
    parser.add_argument("--fix", metavar="JOINT", action="append", default=[], help="hold at zero; may be given again")


def run(args: argparse.Namespace) -> Report:
    """Write the draft; an existing one is not overwritten."""
    urdf = resolved(args.urdf, Path.cwd())
    if not urdf.is_file():
        raise ConfigurationError(f"there is no file {urdf}")
    folder = args.out or Path(urdf.stem)
    file = folder / YAML_NAME
    if file.exists():
        raise ConfigurationError(f"{file} exists: a draft does not overwrite what somebody may have worked on")
    made = draft(urdf if args.urdf.startswith("package://") else urdf.resolve(), folder.name, args.fix)
    folder.mkdir(parents=True, exist_ok=True)
    file.write_text(made.text, encoding="utf-8")
    guesses = "\n".join(f"  {guess}" for guess in made.guesses)
    return Report(
        success=True,
        figures={"success": True, "folder": str(folder), "guesses": list(made.guesses)},
        text=f"wrote {file}; guessed:\n{guesses}\nnext: ./aerial check {folder}",
    )
