"""``aerial demo``: three nodes as processes over DDS, in real time; four jumps, each from where the last one ended."""

from __future__ import annotations

import argparse
import bisect
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_operator.client import connected
from aerial_operator.console import Report, percent, say, table
from aerial_operator.live import Attempt, attempt, await_ready, keep_apart
from aerial_operator.picture import save_picture
from aerial_operator.processes import PLANNER, SIMULATOR, NodeProcesses, parameters
from aerial_operator.recording.recorder import Recorder
from aerial_operator.recording.verdict import Verdict, verdicts

MOTION = "jump"
JUMPS = {
    "0.3 m forward": (0.3, 0.0, 0.0),
    "0.2 m backward": (-0.2, 0.0, 0.0),
    "0.2 m to the left": (0.0, 0.2, 0.0),
    "0.6 m onto a platform": (0.6, 0.0, 0.16),
}  # displacement of the landing [m]
_NICENESS = 5  # of this process: recording can wait


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add noise and the place of the results."""
    parser.add_argument("--noise", choices=("nominal", "off"), default="nominal", help="(default: nominal)")
    parser.add_argument("--out", metavar="FOLDER", type=Path, default=Path("out"), help="of the results (default: out)")


def run(args: argparse.Namespace) -> Report:
    """Run the jumps, judge them by ground truth, leave a recording and a picture."""
    robot = Robot.load(args.robot)
    folder = args.out / "demo"
    folder.mkdir(parents=True, exist_ok=True)
    keep_apart()
    log = folder / "nodes.log"
    told = parameters(args.robot, seed=args.seed, noise=args.noise)
    told[PLANNER.name]["warm_up"] = MOTION
    with log.open("w") as file, NodeProcesses(told, file) as nodes, connected(nodes.check) as client:
        os.nice(_NICENESS)
        recorder = Recorder(client)
        say(f"simulator, controller and planner start as three processes; they log to {log}")
        await_ready(client)
        before, began = client.figures(SIMULATOR), time.time()
        jumps = [
            attempt(robot, client, recorder, name, _request(robot, displacement))
            for name, displacement in JUMPS.items()
        ]
        control = _control_figures(before, client.figures(SIMULATOR), recorder, began)
    say("judging by ground truth, writing the recording, drawing")
    recorder.write(folder / "recording")
    judged = verdicts(robot, recorder, [jump.execution for jump in jumps if jump.execution is not None])
    of_request = {verdict.run.plan.request_id: verdict for verdict in judged}
    motions = [_motion_figures(robot, jump, of_request.get(jump.request_id), args) for jump in jumps]
    landed = all(motion["landed"] for motion in motions)
    figures = {
        "landed": landed,
        "motions": motions,
        "control": control,
        "recording": str(folder / "recording"),
        "picture": str(_draw(judged[-1], folder / "jump.png")) if judged else None,
    }
    return Report(success=landed, figures=figures, text=_summary(figures))


def _request(robot: Robot, displacement: tuple[float, ...]) -> MotionRequest:
    request = MotionRequest(motion=MOTION, displacement=displacement)
    return request.with_platform(robot) if displacement[2] else request


def _control_figures(
    before: Mapping[str, str], after: Mapping[str, str], recorder: Recorder, began: float
) -> dict[str, Any]:
    """Return how the control loop kept up between two diagnostics of the simulator, the first at ``began`` [s]."""
    arrival = recorder.arrivals("state")
    sequence = [message.sequence for message in recorder.messages("state")]
    first = bisect.bisect(arrival, began)
    return {
        "rate_hz": (sequence[-1] - sequence[first]) / (arrival[-1] - arrival[first]),
        "ticks": int(after["ticks"]) - int(before["ticks"]),
        "missed_ticks": int(after["missed_ticks"]) - int(before["missed_ticks"]),
        "round_trip_us": {name: float(after[f"round_trip_us_{name}"]) for name in ("p50", "p99")},
    }


def _motion_figures(robot: Robot, jump: Attempt, verdict: Verdict | None, args: argparse.Namespace) -> dict[str, Any]:
    last = jump.answers[-1]
    return {
        "motion": MOTION,
        "asked": jump.name,
        "robot": robot.name,
        "seed": args.seed,
        "noise": args.noise,
        "planning_time_s": jump.answers[0].after,
        **({"landed": False, "checks": {}, "plan": None} if verdict is None else verdict.to_json()),
        "refusal": None if last.code is None else {"code": last.code.value, "reason": last.reason},
    }


def _draw(verdict: Verdict, path: Path) -> Path:
    """Draw a jump on the terrain that was there."""
    save_picture(verdict.run, path)
    return path


def _summary(figures: Mapping[str, Any]) -> str:
    control = figures["control"]
    share = control["missed_ticks"] / max(control["ticks"], 1)
    round_trip = control["round_trip_us"]
    header = ("jump", "planned in", "landed", "at", "tilt", "peak torque", "peak voltage")
    return "\n".join(
        [
            table(header, [_row(motion) for motion in figures["motions"]]),
            "",
            f"  control    {control['rate_hz']:.0f} Hz, {control['missed_ticks']} of {control['ticks']} ticks missed "
            f"({100 * share:.2f} %), round trip {round_trip['p50']:.0f} µs (99 %: {round_trip['p99']:.0f} µs)",
            f"  recording  {figures['recording']}",
            f"  picture    {figures['picture'] or 'none: no jump happened'}",
        ]
    )


def _row(motion: Mapping[str, Any]) -> list[str]:
    name, planned = motion["asked"], f"{motion['planning_time_s']:.2f} s"
    if not motion["checks"]:
        return [name, planned, f"no, refused: {motion['refusal']['reason']}", *["–"] * 4]
    failed = [check for check, holds in motion["checks"].items() if not holds]
    return [
        name,
        planned,
        "yes" if motion["landed"] else f"no: not {', '.join(failed)}",
        ", ".join(f"{x:z.2f}" for x in motion["landing_position_m"]) + " m",
        f"{motion['tilt_deg']:.1f}°",
        percent(motion["peak_torque_ratio"]),
        percent(motion["peak_voltage_ratio"]),
    ]
