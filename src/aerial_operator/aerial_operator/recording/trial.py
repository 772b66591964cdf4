"""One motion of a recorded run, judged from ground truth by the same rules as in simulation without ROS."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerial_evaluation.judgement.landing import OBSERVE_TIME, Landing, Tick, judge
from aerial_model.robot.robot import Robot
from aerial_model.values.frame import StartFrame
from aerial_model.values.plan import Plan
from aerial_msgs.msg import ControllerStatus
from aerial_operator.recording.recorder import Recorder
from aerial_planner.assembly.actuator_use import actuator_use
from aerial_planner.assembly.touchdown import landing_position
from aerial_ros.messages import from_stamp, plan_from_message
from aerial_sim.ground_truth import GroundTruth
from aerial_sim.ros.messages import ground_truth_from_message

MICRO = 1e6  # microseconds in a second
TIME_TOLERANCE = 1e-6  # between stamps [s]


@dataclass(frozen=True, kw_only=True)
class Execution:
    """A plan that the controller began."""

    plan: Plan  # in the start heading frame
    start_time: float  # of the plan's time 0 [s]

    @property
    def end_time(self) -> float:
        """When the landing has been observed long enough to judge it [s]."""
        return self.start_time + self.plan.landing_time + OBSERVE_TIME


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What came of one motion."""

    execution: Execution
    ticks: list[Tick]  # from its start to its end
    statuses: list[ControllerStatus]  # meanwhile
    landing: Landing
    displacement: np.ndarray  # (3,) of the support centre from start to end, in the start heading frame [m]
    real_time_factor: float  # simulated over wall time

    def to_json(self, robot: Robot) -> dict[str, Any]:
        """Return the figures under the names that ``./aerial simulate --json`` gives them."""
        return {
            **self.landing.to_json(),
            "landing_position_m": self.displacement.tolist(),
            "tick_us": _tick_figures(self.statuses),
            "real_time_factor": self.real_time_factor,
            "plan": _plan_figures(self.execution.plan, robot),
        }


def execution(robot: Robot, recorder: Recorder, request_id: str) -> Execution | None:
    """Return the plan of a request and when it began; None if it did not."""
    statuses = recorder.messages("controller_status")
    running = [status for status in statuses if status.request_id == request_id and status.time_in_plan > 0]
    plans = [message for message in recorder.messages("motion_plan") if message.request_id == request_id]
    if not running or not plans:
        return None
    start_time = from_stamp(running[0].stamp) - running[0].time_in_plan
    return Execution(plan=plan_from_message(plans[0], robot), start_time=start_time)


def judged(robot: Robot, recorder: Recorder, executions: list[Execution]) -> list[Trial]:
    """Return the verdicts on executions.

    Raises:
        ValueError: if the recording does not cover one of them.
    """
    arrivals = np.array(recorder.arrivals("ground_truth"))
    truths = [ground_truth_from_message(message) for message in recorder.messages("ground_truth")]
    statuses = list(recorder.messages("controller_status"))
    return [_trial(robot, done, arrivals, truths, statuses) for done in executions]


def _trial(
    robot: Robot, done: Execution, arrivals: np.ndarray, truths: list[GroundTruth], statuses: list[ControllerStatus]
) -> Trial:
    """Return the verdict on an execution, from all that was recorded."""
    first, last = done.start_time - TIME_TOLERANCE, done.end_time + TIME_TOLERANCE
    seen = [k for k, truth in enumerate(truths) if first <= truth.time <= last]
    truths = [truths[k] for k in seen]
    wall_time = arrivals[seen[-1]] - arrivals[seen[0]]
    statuses = [status for status in statuses if first <= from_stamp(status.stamp) <= last]
    frame = StartFrame.of(robot, truths[0].q)
    ticks = _ticks(truths, statuses)
    landing = judge(robot, done.plan, frame=frame, start_time=done.start_time, ticks=ticks)
    end = StartFrame.of(robot, truths[-1].q).origin
    return Trial(
        execution=done,
        ticks=ticks,
        statuses=statuses,
        landing=landing,
        displacement=frame.R_SW @ (end - frame.origin),
        real_time_factor=float((truths[-1].time - truths[0].time) / wall_time),
    )


def _ticks(truths: list[GroundTruth], statuses: list[ControllerStatus]) -> list[Tick]:
    """Return the control periods; what was counted between two statuses is laid on the first periods there."""
    fallback = np.zeros(len(truths), dtype=bool)
    time = np.array([truth.time for truth in truths])
    for before, after in itertools.pairwise(statuses):
        count = after.fallback_ticks - before.fallback_ticks
        if count:
            first = int(np.searchsorted(time, from_stamp(before.stamp)))
            fallback[first : first + count] = True
    return [Tick(truth=truth, fallback=bool(fell_back)) for truth, fell_back in zip(truths, fallback, strict=True)]


def _tick_figures(statuses: list[ControllerStatus]) -> dict[str, float]:
    """Return the controller's tick times [µs]: medians of the periods between statuses, and the greatest of all."""
    return {
        "p50": float(np.median([status.tick_time_p50 for status in statuses]) * MICRO),
        "p99": float(np.median([status.tick_time_p99 for status in statuses]) * MICRO),
        "max": float(max(status.tick_time_max for status in statuses) * MICRO),
    }


def _plan_figures(plan: Plan, robot: Robot) -> dict[str, Any]:
    use = actuator_use(plan, robot)
    return {
        "take_off_time_s": plan.take_off_time,
        "flight_time_s": plan.landing_time - plan.take_off_time,
        "rotation_deg": np.degrees(plan.rotation).tolist(),
        "landing_position_m": landing_position(plan, robot).tolist(),
        "peak_torque_ratio": float(use.torque_ratio.max()),
        "peak_voltage_ratio": float(use.voltage_ratio.max()),
        "peak_speed_ratio": float(use.speed_ratio.max()),
    }
