"""Fingerprints of whole runs: hashes that show, to the last bit, whether a change left the robot as it was."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from aerial_evaluation.closed_loop import run
from aerial_evaluation.judgement.landing import Landing, judge
from aerial_evaluation.record import Run
from aerial_model.config import from_mapping, load_yaml
from aerial_model.errors import ConfigurationError, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.command import Command
from aerial_model.values.plan import Plan
from aerial_model.values.request import MotionRequest
from aerial_planner.planner import Planner

USUAL = Path(__file__).with_name("runs.yaml")
_COMMAND_ROWS = ("torque", "position", "velocity", "stiffness", "damping")
_PLAN_ARRAYS = ("time", "q", "v", "com", "com_velocity", "angular_momentum", "foot_position", "force", "contact")
_PLAN_LANDING = ("landing_joint_position", "landing_support_centre", "rotation")
_PLAN_NUMBERS = ("take_off_time", "landing_time", "landing_com_height", "landing_yaw")


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """One run to be made; the fields are those of a request, and the terrain along the jump."""

    robot: str  # name or folder
    motion: str
    displacement: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) [m]
    yaw: float = 0.0  # [rad]
    rotation: float | None = None  # signed turns
    variant: str = "AAKD*"
    warm_start: bool = True
    optimize_timing: bool = False
    platform: bool = False  # as high as the goal
    hurdle: float | None = None  # its height [m]
    gap: float | None = None  # its width [m]
    seed: int = 0

    @property
    def name(self) -> str:
        """What it is, in one line: the same for equal cases."""
        usual = {each.name: each.default for each in dataclasses.fields(self)}
        said = {
            key: value for key, value in vars(self).items() if key not in ("robot", "motion", "displacement", "seed")
        }
        words = [f"{key}={value}" for key, value in said.items() if value != usual[key]]
        to = ",".join(f"{x:g}" for x in self.displacement)
        return " ".join([self.robot, self.motion, f"to={to}", *words, f"seed={self.seed}"])

    def request(self, robot: Robot) -> MotionRequest:
        """Return the request of this run."""
        request = MotionRequest(
            motion=self.motion,
            displacement=self.displacement,
            yaw=self.yaw,
            rotation=self.rotation,
            variant=self.variant,
            warm_start=self.warm_start,
            optimize_timing=self.optimize_timing,
        )
        if self.platform:
            request = request.with_platform(robot)
        if self.hurdle is not None:
            request = request.with_hurdle(robot, self.hurdle)
        return request if self.gap is None else request.with_gap(robot, self.gap)


@dataclass(frozen=True, kw_only=True)
class Fingerprint:
    """What a run was, to the last bit."""

    name: str  # of the case
    plan: str | None = None  # SHA-256 of the plan's numbers; None: refused
    commands: str | None = None  # of the joint commands of every tick
    landing: Landing | None = None
    refusal: str | None = None

    @staticmethod
    def of(name: str, record: Run) -> Fingerprint:
        """Return the fingerprint of a run."""
        return Fingerprint(
            name=name,
            plan=plan_hash(record.plan),
            commands=commands_hash(record.commands),
            landing=judge(record),
        )

    def to_json(self) -> dict[str, Any]:
        """Return the row of the JSON object."""
        landing = None if self.landing is None else self.landing.to_json()
        return {
            "name": self.name,
            "plan": self.plan,
            "commands": self.commands,
            "landing": landing,
            "refusal": self.refusal,
        }


def cases(file: Path = USUAL) -> list[Case]:
    """Return the runs that a YAML file lists under ``runs``.

    Raises:
        ConfigurationError: if it cannot be read, or lists something else.
    """
    listed = load_yaml(file).get("runs")
    if not isinstance(listed, list) or not listed:
        raise ConfigurationError(f"{file}: expected a list of runs under the key 'runs'")
    return [from_mapping(Case, each, f"{file}: run {k}") for k, each in enumerate(listed)]


def fingerprints(todo: Iterable[Case]) -> Iterator[Fingerprint]:
    """Yield the fingerprint of every case as it comes; a refusal has one too."""
    planners: dict[str, Planner] = {}
    for case in todo:
        if case.robot not in planners:
            planners[case.robot] = Planner(Robot.load(case.robot))
        planner = planners[case.robot]
        try:
            record = run(planner.robot, case.request(planner.robot), seed=case.seed, planner=planner)
        except RefusalError as refusal:
            yield Fingerprint(name=case.name, refusal=refusal.reason)
        else:
            yield Fingerprint.of(case.name, record)


def plan_hash(plan: Plan) -> str:
    """Return the SHA-256 of a plan's numbers."""
    return _hash(getattr(plan, name) for name in (*_PLAN_ARRAYS, *_PLAN_LANDING, *_PLAN_NUMBERS))


def commands_hash(commands: Sequence[Command]) -> str:
    """Return the SHA-256 of joint commands, in their order."""
    return _hash(getattr(command, name) for command in commands for name in _COMMAND_ROWS)


def _hash(values: Iterable[np.ndarray | float]) -> str:
    digest = hashlib.sha256()
    for value in values:
        digest.update(np.ascontiguousarray(value, dtype=np.float64).tobytes())
    return digest.hexdigest()


def differences(rows: Sequence[Mapping[str, Any]], before: Sequence[Mapping[str, Any]]) -> dict[str, list[str]]:
    """Return what differs from the rows of an earlier time: name → what; a run that was not made then differs in all."""
    then = {row["name"]: row for row in before}
    result = {}
    for row in rows:
        old = then.get(row["name"])
        found = ["not made before"] if old is None else [key for key in row if row[key] != old.get(key)]
        if found:
            result[row["name"]] = found
    return result


def load(file: Path) -> list[dict[str, Any]]:
    """Return the rows that ``./aerial bench runs`` wrote.

    Raises:
        ConfigurationError: if the file cannot be read or holds something else.
    """
    try:
        rows = json.loads(file.read_text(encoding="utf-8"))["rows"]
        return [{**row, "name": row["name"]} for row in rows]
    except OSError as error:
        raise ConfigurationError(f"{file}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError):
        raise ConfigurationError(
            f"{file}: expected what ./aerial bench runs wrote, a JSON object with 'rows'"
        ) from None
