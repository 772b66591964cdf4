"""The verdict on every motion of a recording, from ground truth, by the rules of ``./aerial simulate``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from aerial_evaluation.judgement.landing import Landing, judge
from aerial_evaluation.record import Run
from aerial_model.errors import RefusalCode
from aerial_model.robot.robot import Robot
from aerial_model.values.request import ControllerCommand
from aerial_operator.recording.recording import Recording
from aerial_operator.recording.runs import Execution, execution, runs
from aerial_planner.assembly.actuator_use import actuator_use
from aerial_planner.assembly.touchdown import landing_position
from aerial_ros.messages import code_from_message, outcome_from_message


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What came of one motion that was executed."""

    run: Run
    landing: Landing

    def to_json(self) -> dict[str, Any]:
        """Return the figures under the names that ``./aerial simulate --json`` gives them."""
        timing = self.run.timing
        return {
            **self.landing.to_json(),
            "landing_position_m": self.run.displacement.tolist(),
            "tick_us": None if timing is None or timing.tick is None else timing.tick.to_json(),
            "real_time_factor": None if timing is None else timing.real_time_factor,
            "plan": self._plan_to_json(),
        }

    def _plan_to_json(self) -> dict[str, Any]:
        plan = self.run.plan
        use = actuator_use(plan, self.run.robot)
        return {
            "take_off_time_s": plan.take_off_time,
            "flight_time_s": plan.landing_time - plan.take_off_time,
            "rotation_deg": np.degrees(plan.rotation).tolist(),
            "landing_position_m": landing_position(plan, self.run.robot).tolist(),
            "peak_torque_ratio": float(use.torque_ratio.max()),
            "peak_voltage_ratio": float(use.voltage_ratio.max()),
            "peak_speed_ratio": float(use.speed_ratio.max()),
        }


def verdicts(robot: Robot, recording: Recording, executions: list[Execution]) -> list[Verdict]:
    """Return the verdicts on executions.

    Raises:
        RecordingError: if the recording has no ground truth of one of them.
        IncompleteRunError: if its ground truth does not cover one of them.
    """
    return [Verdict(run=run, landing=judge(run)) for run in runs(robot, recording, executions)]


@dataclass(frozen=True, kw_only=True)
class RecordedMotion:
    """A motion that a recording holds: asked for, and executed or not."""

    request_id: str
    motion: str
    verdict: Verdict | None  # None: it never began
    outcome: str  # the last answer to the selection, a constant of ``MotionResult`` in lower case; empty: none
    code: RefusalCode | None  # of that answer
    reason: str

    @property
    def landed(self) -> bool:
        """Whether it was executed and landed, by ground truth."""
        return self.verdict is not None and self.verdict.landing.landed

    def to_json(self) -> dict[str, Any]:
        """Return the row of ``./aerial report --json``."""
        unjudged = {"landed": False, "checks": {}, "plan": None}
        return {
            "motion": self.motion,
            "request_id": self.request_id,
            "outcome": self.outcome,
            **(unjudged if self.verdict is None else self.verdict.to_json()),
            "refusal": None if self.code is None else {"code": self.code.value, "reason": self.reason},
        }


def motions(robot: Robot, recording: Recording) -> list[RecordedMotion]:
    """Return every motion that a recording holds, in the order they were asked for.

    Raises:
        InvalidPlanError: if it is another robot's.
        RecordingError: if the recording has no ground truth of a motion.
        IncompleteRunError: if it ends before a motion has been observed.
    """
    asked: dict[str, str] = {}  # request id → motion
    for topic in ("motion_selection", "motion_plan"):
        for message in recording.messages(topic):
            if message.motion not in list(ControllerCommand):
                asked.setdefault(message.request_id, message.motion)
    answers = {message.request_id: message for message in recording.messages("motion_result")}
    executions = {request_id: execution(robot, recording, request_id) for request_id in asked}
    done = [each for each in executions.values() if each is not None]
    judged = {each.run.plan.request_id: each for each in verdicts(robot, recording, done)}
    return [
        RecordedMotion(
            request_id=request_id,
            motion=motion,
            verdict=judged.get(request_id),
            outcome=outcome_from_message(answers[request_id]) if request_id in answers else "",
            code=code_from_message(answers[request_id]) if request_id in answers else None,
            reason=answers[request_id].reason if request_id in answers else "",
        )
        for request_id, motion in asked.items()
    ]
