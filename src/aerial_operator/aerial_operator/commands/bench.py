"""``aerial bench``: timing tables."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from aerial_evaluation.bench import controller, crocoddyl_peer, planner, runs, tsid_peer
from aerial_evaluation.bench.environment import Environment
from aerial_evaluation.bench.machine import machine
from aerial_evaluation.bench.planner import measured
from aerial_evaluation.bench.subject import Subject, motions_of
from aerial_model.config import closest
from aerial_model.errors import ConfigurationError
from aerial_model.robot.robot import Robot
from aerial_operator.bench import loop
from aerial_operator.bench.tables import tables
from aerial_operator.console import Report, UsageError, say, table, to_json
from aerial_operator.options.planning import compile_functions
from aerial_planner.codegen.library import default_cache
from aerial_planner.formulation.limits import Variant

SECTIONS = {"planner": planner.SECTIONS, "controller": controller.SECTIONS}
PEERS = {peer.name: peer for peer in (crocoddyl_peer.PEER, tsid_peer.PEER)}  # by the section that compares with it
REPEATS = 10
GOALS = 50
SECONDS = 60.0  # [s]
_HASH_SHOWN = 12  # digits of a hash that a table shows


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what is measured, how much of it, and where the figures go."""
    parser.add_argument(
        "what",
        metavar="WHAT",
        choices=(*SECTIONS, "loop", "runs"),
        help=f"{', '.join(SECTIONS)}, loop, or runs: hashes of whole runs, to compare a change with what was before",
    )
    parser.add_argument(
        "--sections",
        metavar="NAME[,…]",
        type=_names,
        help="of the benchmark (default: all, of peers those that are installed): "
        + "; ".join(f"{what}: {', '.join(sections)}" for what, sections in SECTIONS.items()),
    )
    parser.add_argument(
        "--motions",
        metavar="NAME[,…]",
        type=_names,
        help=f"(default: for the planner all it has the contacts for, for the controller {', '.join(controller.MOTIONS)})",
    )
    parser.add_argument("--repeats", metavar="N", type=int, default=REPEATS, help=f"(default: {REPEATS})")
    parser.add_argument(
        "--goals", metavar="N", type=int, default=GOALS, help=f"of each motion, for the planner (default: {GOALS})"
    )
    parser.add_argument(
        "--interpreted",
        action="store_true",
        help="for the planner: leave out what `aerial compile` does; else it is done first",
    )
    parser.add_argument(
        "--with-peers",
        action="store_true",
        help=f"install {' or '.join(PEERS)}, whichever is asked for, in an environment of its own, if it is not there",
    )
    parser.add_argument(
        "--seconds", metavar="N", type=float, default=SECONDS, help=f"that the loop runs for (default: {SECONDS:.0f})"
    )
    parser.add_argument("--list", metavar="FILE", type=Path, help="YAML of the runs (default: 30 that come with it)")
    parser.add_argument("--only", metavar="N[,…]", type=_numbers, help="these of the runs, counted from 0")
    parser.add_argument(
        "--against", metavar="FILE", type=Path, help="what `bench runs` wrote before: it fails if a run differs from it"
    )
    parser.add_argument("--out", metavar="FOLDER", type=Path, default=Path("out/bench"), help="(default: out/bench)")


def run(args: argparse.Namespace) -> Report:
    """Measure section by section; the file holds what is measured so far, if a long run is interrupted."""
    if args.what == "loop":
        return _loop(args)
    if args.what == "runs":
        return _runs(args)
    sections = _sections(args)
    robot = Robot.load(args.robot)
    subject = Subject(
        robot=robot,
        motions=args.motions or _motions(args.what, robot),
        repeats=args.repeats,
        goals=args.goals,
        seed=args.seed,
        folder=args.out,
        cache=None if args.interpreted else default_cache(),
        progress=say,
    )
    figures = {
        "machine": machine(),
        "seed": args.seed,
        "repeats": args.repeats,
        "goals": args.goals,
        "compiled": not args.interpreted,
        "rows": [],
    }
    file = args.out / f"{args.what}.json"
    _write(file, to_json(figures))  # before an hour is spent on what cannot be written
    if args.what == "planner" and not args.interpreted:
        compile_functions(robot, subject.motions, Variant)
    for row in measured(subject, sections, SECTIONS[args.what]):
        figures["rows"].append(row)
        _write(file, to_json(figures))
    say(f"figures are in {file}")
    return Report(success=True, figures=figures, text=tables(figures["rows"]))


def _motions(what: str, robot: Robot) -> tuple[str, ...]:
    """Return the motions that are measured unless others are asked for."""
    motions = motions_of(robot)
    return motions if what == "planner" else tuple(name for name in motions if name in controller.MOTIONS)


def _loop(args: argparse.Namespace) -> Report:
    """Measure the control loop; it succeeds if the robot stayed on its feet to the end."""
    file = args.out / "loop.json"
    _write(file, "{}")  # before a minute is spent on what cannot be written
    figures = loop.measure(
        args.robot, motions=args.motions or (), seconds=args.seconds, seed=args.seed, folder=args.out
    )
    _write(file, to_json(figures))
    say(f"figures are in {file}")
    return Report(success=figures["complete"], figures=figures, text=loop.tables(figures))


def _runs(args: argparse.Namespace) -> Report:
    """Make runs and take their fingerprints; it succeeds unless one differs from those it is compared with."""
    listed = runs.cases(args.list or runs.USUAL)
    for number in args.only or ():
        if not 0 <= number < len(listed):
            raise UsageError(f"--only: there are runs 0 to {len(listed) - 1}, found {number}")
    todo = [listed[number] for number in args.only] if args.only else listed
    before = None if args.against is None else runs.load(args.against)
    file = args.out / "runs.json"
    figures: dict[str, Any] = {"machine": machine(), "rows": []}
    for case, fingerprint in zip(todo, runs.fingerprints(todo), strict=True):
        figures["rows"].append(fingerprint.to_json())
        _write(file, to_json(figures))
        say(f"{case.name}: {fingerprint.refusal or 'done'}")
    differing = {} if before is None else runs.differences(json.loads(to_json(figures))["rows"], before)
    if before is not None:
        figures["against"], figures["differing"] = str(args.against), differing
    say(f"figures are in {file}")
    return Report(success=not differing, figures=figures, text=_fingerprints(figures["rows"], before, differing))


def _fingerprints(rows: list[dict[str, Any]], before: object, differing: dict[str, list[str]]) -> str:
    lines = [
        [row["name"], *(str(row[key])[:_HASH_SHOWN] for key in ("plan", "commands")), _verdict(row)] for row in rows
    ]
    text = table(("run", "plan", "commands", "landed"), lines)
    if before is None:
        return text
    equal = f"{len(rows) - len(differing)} of {len(rows)} are as before, to the last bit"
    return "\n".join([text, "", equal, *(f"differs: {name}: {', '.join(what)}" for name, what in differing.items())])


def _verdict(row: dict[str, Any]) -> str:
    if row["landing"] is None:
        return f"refused: {row['refusal']}"
    failed = [name for name, holds in row["landing"]["checks"].items() if not holds]
    return f"no: not {', '.join(failed)}" if failed else "yes"


def _sections(args: argparse.Namespace) -> list[str]:
    """Return what to measure; a peer that is not installed is left out, unless it is asked for."""
    known = SECTIONS[args.what]
    for name in args.sections or ():
        if name not in known:
            raise UsageError(f"no section '{name}'{closest(name, known)}; there are {', '.join(known)}")
    sections = list(args.sections or known)
    for name in [name for name in sections if name in PEERS]:
        environment = Environment(PEERS[name])
        if args.with_peers and not environment.is_made:
            say(f"installing {name} in {environment.folder}")
            environment.make()
        if not environment.is_made:
            if args.sections:
                raise ConfigurationError(environment.missing)
            say(f"left out: {environment.missing}")
            sections.remove(name)
    return sections


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())


def _numbers(text: str) -> tuple[int, ...]:
    try:
        return tuple(int(number) for number in _names(text))
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected numbers such as 0,5,9; found '{text}'") from None


def _write(file: Path, text: str) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise ConfigurationError(f"{file}: cannot be written ({error.strerror})") from None
