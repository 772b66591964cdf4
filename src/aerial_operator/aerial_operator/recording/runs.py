"""The records of the motions in a recording: what was executed, from live nodes and from a bag on disk alike."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from aerial_evaluation.judgement.landing import OBSERVE_TIME
from aerial_evaluation.record import Run, Tick, TickTimes, Timing
from aerial_model.robot.robot import Robot
from aerial_model.values.command import Command
from aerial_model.values.frame import StartFrame
from aerial_model.values.measurement import Measurement
from aerial_model.values.plan import Plan
from aerial_msgs.msg import ControllerStatus
from aerial_operator.recording.recording import Recording, RecordingError
from aerial_ros.messages import from_stamp, plan_from_message
from aerial_ros.wire import CommandWire, StateWire
from aerial_sim.ground_truth import GroundTruth
from aerial_sim.ros.messages import ground_truth_from_message

TIME_TOLERANCE = 1e-6  # between stamps [s]
_Packet = TypeVar("_Packet", Measurement, Command)


@dataclass(frozen=True, kw_only=True)
class Execution:
    """A plan that the controller began."""

    plan: Plan  # in the start heading frame
    start_time: float  # of the plan's time 0 [s]

    @property
    def end_time(self) -> float:
        """When the landing has been observed long enough to judge it [s]."""
        return self.start_time + self.plan.landing_time + OBSERVE_TIME


def execution(robot: Robot, recording: Recording, request_id: str) -> Execution | None:
    """Return the plan of a request and when it began; None if it did not.

    Raises:
        InvalidPlanError: if the plan is for another robot.
    """
    statuses = recording.messages("controller_status")
    running = [status for status in statuses if status.request_id == request_id and status.time_in_plan > 0]
    plans = [message for message in recording.messages("motion_plan") if message.request_id == request_id]
    if not running or not plans:
        return None
    start_time = from_stamp(running[0].stamp) - running[0].time_in_plan
    return Execution(plan=plan_from_message(plans[0], robot), start_time=start_time)


def runs(robot: Robot, recording: Recording, executions: Iterable[Execution]) -> list[Run]:
    """Return the records of executions, each from its start to the end of its observation.

    A recording knows no estimates of every tick, and what it keeps of states and commands may have gaps.

    Raises:
        RecordingError: if the recording has no ground truth of one of them.
    """
    messages = _Messages(robot, recording)
    return [messages.run(execution) for execution in executions]


class _Messages:
    """The messages of a recording, decoded once for all of its motions."""

    def __init__(self, robot: Robot, recording: Recording) -> None:
        self._robot = robot
        self._arrivals = recording.arrivals("ground_truth")
        self._truths = [ground_truth_from_message(message) for message in recording.messages("ground_truth")]
        self._statuses: list[ControllerStatus] = list(recording.messages("controller_status"))
        self._measurements = _decoded(recording, "state", StateWire(robot).read, lambda state: state.time)
        self._commands = _decoded(recording, "joint_command", CommandWire(robot).read, lambda each: each.state_time)

    def run(self, done: Execution) -> Run:
        """Return the record of an execution."""
        first, last = done.start_time - TIME_TOLERANCE, done.end_time + TIME_TOLERANCE
        seen = [k for k, truth in enumerate(self._truths) if first <= truth.time <= last]
        if not seen:
            raise RecordingError(
                f"the recording has no ground truth of '{done.plan.motion}', "
                f"which ran from {done.start_time:.3f} s to {done.end_time:.3f} s: nothing can be judged"
            )
        truths = [self._truths[k] for k in seen]
        statuses = [status for status in self._statuses if first <= from_stamp(status.stamp) <= last]
        wall_time = self._arrivals[seen[-1]] - self._arrivals[seen[0]]
        start_frame = StartFrame.of(self._robot, truths[0].q)
        return Run(
            robot=self._robot,
            plan=done.plan,
            start_frame=start_frame,
            start_time=done.start_time,
            ticks=self._ticks(truths, statuses),
            terrain=done.plan.terrain.placed(start_frame),
            timing=Timing(
                tick=_tick_times(statuses),
                real_time_factor=(truths[-1].time - truths[0].time) / wall_time if wall_time > 0 else np.nan,
            ),
        )

    def _ticks(self, truths: Sequence[GroundTruth], statuses: Sequence[ControllerStatus]) -> list[Tick]:
        """Return the control periods; a state and its command belong to the period that begins at their stamp."""
        time = np.array([truth.time for truth in truths])
        fallback = _fallbacks(time, statuses)
        begin = time - np.median(np.diff(time)) if len(time) > 1 else time
        return [
            Tick(
                truth=truth,
                measurement=self._measurements.get(_key(began)),
                command=self._commands.get(_key(began)),
                fallback=bool(fell_back),
            )
            for truth, began, fell_back in zip(truths, begin, fallback, strict=True)
        ]


def _decoded(
    recording: Recording, topic: str, read: Callable[[bytes], _Packet], time: Callable[[_Packet], float]
) -> dict[int, _Packet]:
    packets = [read(data) for data in recording.serialized(topic)]
    return {_key(time(packet)): packet for packet in packets}


def _key(time: float) -> int:
    """Return a time in whole tolerances, so that stamps that differ by rounding alone are equal."""
    return round(time / TIME_TOLERANCE)


def _fallbacks(time: np.ndarray, statuses: Sequence[ControllerStatus]) -> np.ndarray:
    """Return in which periods ``(K,)`` the controller fell back.

    What was counted between two statuses is laid on the first periods there.
    """
    fallback = np.zeros(len(time), dtype=bool)
    for before, after in itertools.pairwise(statuses):
        count = after.fallback_ticks - before.fallback_ticks
        if count > 0:
            first = int(np.searchsorted(time, from_stamp(before.stamp)))
            fallback[first : first + count] = True
    return fallback


def _tick_times(statuses: Sequence[ControllerStatus]) -> TickTimes | None:
    """Return the controller's tick times: medians of the periods between statuses, and the greatest of all."""
    if not statuses:
        return None
    return TickTimes(
        p50=float(np.median([status.tick_time_p50 for status in statuses])),
        p99=float(np.median([status.tick_time_p99 for status in statuses])),
        max=float(max(status.tick_time_max for status in statuses)),
    )
