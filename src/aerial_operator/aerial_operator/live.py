"""Motions asked of nodes of our own that run in real time, one after another."""

from __future__ import annotations

import os
from dataclasses import dataclass

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_operator.client import Answer, Client
from aerial_operator.console import say
from aerial_operator.recording.recorder import Recorder
from aerial_operator.recording.runs import Execution, execution

READY_TIMEOUT = 180.0  # a planner builds the problems of all motions first, beside a control loop that comes first [s]
OBSERVE_SPARE = 0.2  # after a landing's observation: its last ground truth may arrive after the clock [s]
STATE_TIMEOUT = 10.0  # for simulated time to go on [s]
_DOMAINS = 100  # ROS domains 1 … 100, of which this process takes one


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """One motion that was asked for."""

    name: str  # for a person
    request: MotionRequest
    request_id: str
    answers: list[Answer]
    execution: Execution | None  # None: it never began


def keep_apart() -> None:
    """Give this process and those it starts a ROS domain of their own, on this machine alone."""
    os.environ["ROS_DOMAIN_ID"] = str(os.getpid() % _DOMAINS + 1)
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"


def await_ready(client: Client) -> None:
    """Wait until the robot stands and the planner is warm.

    Raises:
        RefusalError: if it takes too long.
    """
    if not client.wait(lambda: not client.missing and client.warm, READY_TIMEOUT):
        missing = "; ".join(client.missing) or "the planner is warming up"
        raise RefusalError(RefusalCode.TIMEOUT, f"not ready after {READY_TIMEOUT:.0f} s: {missing}")


def attempt(robot: Robot, client: Client, recorder: Recorder, name: str, request: MotionRequest) -> Attempt:
    """Select a motion; wait until it is over and its landing has been observed."""
    say(name)
    request_id, answers = client.select(request, heard=lambda answer: say(f"  {answer}"))
    done = execution(robot, recorder, request_id)
    if done is not None:
        client.wait(lambda: client.time > done.end_time + OBSERVE_SPARE, STATE_TIMEOUT)
    return Attempt(name=name, request=request, request_id=request_id, answers=answers, execution=done)
