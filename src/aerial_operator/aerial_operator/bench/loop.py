"""The control loop's benchmark: every motion in turn over DDS in real time, and how the loop keeps up meanwhile."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerial_evaluation.bench.machine import machine
from aerial_evaluation.bench.subject import motions_of
from aerial_model.errors import ConfigurationError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_operator.client import Client, connected
from aerial_operator.console import pairs, say, table
from aerial_operator.live import Attempt, attempt, await_ready, keep_apart
from aerial_operator.processes import PLANNER, PROGRAMS, SIMULATOR, NodeProcesses, parameters
from aerial_operator.recording.recorder import Recorder
from aerial_operator.recording.recording import TOPICS
from aerial_operator.recording.verdict import Verdict, verdicts
from aerial_planner.motion.motion import load_motion

JUMPS = {"forward": (0.3, 0.0, 0.0), "back": (-0.2, 0.0, 0.0), "left": (0.0, 0.2, 0.0)}  # of motion ``jump`` [m]
_KEPT = ("ground_truth", "controller_status", "motion_plan")  # topics that a verdict needs
_NICENESS = 5  # of this process: listening can wait
_TICKS_PER_SECOND = os.sysconf("SC_CLK_TCK")  # in which Linux counts processor time
_PERCENTILES = ("p50", "p99", "max")


@dataclass(frozen=True, kw_only=True)
class _Measured:
    """What a run of the three nodes left behind."""

    machine: dict[str, Any]  # as it was when the run began
    attempts: list[Attempt]
    seconds: float  # that it lasted [s]
    processor_share: dict[str, float]  # program → processor time over wall time
    loop: dict[str, str]  # the simulator's diagnostics at the end
    recorder: Recorder


def measure(name_or_folder: str, *, motions: Sequence[str], seconds: float, seed: int, folder: Path) -> dict[str, Any]:
    """Return the figures of a run of at least ``seconds`` [s]; a motion that has begun is finished.

    Args:
        name_or_folder: of the robot.
        motions: to go through, over and over; empty: all it has the contacts for.
        seconds: to run for.
        seed: of the simulation.
        folder: of the nodes' log.

    Raises:
        ConfigurationError: if there is no time to measure.
        RefusalError: if nodes die or fall silent.
    """
    if not seconds > 0:
        raise ConfigurationError(f"seconds: expected a positive number, found {seconds}")
    robot = Robot.load(name_or_folder)
    motions = list(motions) or motions_of(robot)
    for motion in motions:
        load_motion(motion, robot)  # an unknown name is one sentence before anything starts
    keep_apart()
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "nodes.log"
    told = parameters(name_or_folder, seed=seed, noise="nominal")
    told[PLANNER.name]["warm_up"] = ",".join(motions)
    with log.open("w") as file, NodeProcesses(told, file) as nodes, connected(nodes.check) as client:
        os.nice(_NICENESS)
        say(f"simulator, controller and planner start as three processes; they log to {log}")
        await_ready(client)
        client.reset_robot(seed)  # what counts begins here
        measured = _run(robot, nodes, client, motions, seconds)
    say("judging by ground truth")
    return _figures(robot, measured, seconds, seed)


def _run(robot: Robot, nodes: NodeProcesses, client: Client, motions: Sequence[str], seconds: float) -> _Measured:
    """Ask for motion after motion for at least ``seconds`` [s], or until the robot has fallen."""
    recorder = Recorder(client, {topic: TOPICS[topic] for topic in _KEPT})
    on = machine()
    began, processor = time.monotonic(), {program.name: _processor_time(nodes.pid(program)) for program in PROGRAMS}
    attempts = []
    for name, request in _in_turn(motions):
        attempts.append(attempt(robot, client, recorder, name, request))
        if client.missing or time.monotonic() - began >= seconds:
            break
    lasted = time.monotonic() - began
    taken = {program.name: _processor_time(nodes.pid(program)) - processor[program.name] for program in PROGRAMS}
    return _Measured(
        machine=on,
        attempts=attempts,
        seconds=lasted,
        processor_share={name: time_taken / lasted for name, time_taken in taken.items()},
        loop=client.figures(SIMULATOR),
        recorder=recorder,
    )


def _figures(robot: Robot, measured: _Measured, seconds: float, seed: int) -> dict[str, Any]:
    """Return the JSON object of a run that was to last ``seconds`` [s]."""
    executions = [each.execution for each in measured.attempts if each.execution is not None]
    judged = {each.run.plan.request_id: each for each in verdicts(robot, measured.recorder, executions)}
    loop = measured.loop
    ticks, missed = int(loop["ticks"]), int(loop["missed_ticks"])
    return {
        "machine": measured.machine,
        "seed": seed,
        "seconds": measured.seconds,
        "complete": measured.seconds >= seconds,
        "control": {
            "rate_hz": float(loop["rate_hz"]),
            "ticks": ticks,
            "missed_ticks": missed,
            "missed_share": missed / max(ticks, 1),
            "late_ticks": int(loop["late_ticks"]),
            "round_trip_us": {name: float(loop[f"round_trip_us_{name}"]) for name in _PERCENTILES},
        },
        "processor_share": measured.processor_share,
        "rows": [_row(each, judged.get(each.request_id)) for each in measured.attempts],
    }


def tables(figures: Mapping[str, Any]) -> str:
    """Return the figures for a person."""
    control = figures["control"]
    header = ("motion", "planned in", "landed", "tilt", "controller's tick, 99 %")
    return "\n".join(
        [
            f"The control loop over DDS in real time, every motion in turn, {figures['seconds']:.0f} s",
            "",
            table(header, [_line(row) for row in figures["rows"]]),
            "",
            pairs(
                [
                    ("rate", f"{control['rate_hz']:.0f} Hz"),
                    (
                        "missed ticks",
                        f"{control['missed_ticks']} of {control['ticks']} ({100 * control['missed_share']:.2f} %)",
                    ),
                    (
                        "round trip",
                        ", ".join(f"{name} {control['round_trip_us'][name]:.0f} µs" for name in _PERCENTILES),
                    ),
                    (
                        "processor",
                        ", ".join(f"{name} {100 * share:.0f} %" for name, share in figures["processor_share"].items()),
                    ),
                ]
            ),
        ]
    )


def _in_turn(motions: Sequence[str]) -> Iterator[tuple[str, MotionRequest]]:
    """Yield name and request of every motion, over and over."""
    requests: list[tuple[str, MotionRequest]] = []
    for motion in motions:
        goals: Mapping[str, tuple[float, ...]] = JUMPS if motion == "jump" else {"": (0.0, 0.0, 0.0)}
        requests += [
            (f"{motion} {name}".strip(), MotionRequest(motion=motion, displacement=goal))
            for name, goal in goals.items()
        ]
    return itertools.cycle(requests)


def _row(done: Attempt, verdict: Verdict | None) -> dict[str, Any]:
    last = done.answers[-1]
    return {
        "motion": done.request.motion,
        "asked": done.name,
        "planning_time_s": done.answers[0].after,
        **({"landed": False, "checks": {}} if verdict is None else verdict.to_json()),
        "refusal": None if last.code is None else {"code": last.code.value, "reason": last.reason},
    }


def _line(row: Mapping[str, Any]) -> list[str]:
    name, planned = row["asked"], f"{row['planning_time_s']:.2f} s"
    if not row["checks"]:
        return [name, planned, f"no, refused: {row['refusal']['reason']}", "–", "–"]
    failed = [check for check, holds in row["checks"].items() if not holds]
    landed = "yes" if row["landed"] else f"no: not {', '.join(failed)}"
    return [name, planned, landed, f"{row['tilt_deg']:.1f}°", f"{row['tick_us']['p99']:.0f} µs"]


def _processor_time(pid: int) -> float:
    """Return the processor time a process has taken so far, all threads, in the kernel and out of it [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_SECOND
