"""The one exception tree of the project: every error a user can cause is an ``AerialError`` with one clear sentence."""

from __future__ import annotations

from enum import StrEnum
from typing import Any


class AerialError(Exception):
    """Base of all errors raised on purpose; its text is one sentence meant for a person."""


class ConfigurationError(AerialError):
    """A YAML file, an option or a robot folder does not say what it must."""


class InvalidPlanError(AerialError):
    """A plan message is inconsistent, not finite, or made for another robot."""


class NumericsError(AerialError):
    """A controller's optimization problem has no usable solution; carries the solver's status."""

    def __init__(self, sentence: str, status: str = "") -> None:
        super().__init__(sentence)
        self.status = status


class RefusalCode(StrEnum):
    """Why a motion was refused, aborted or failed; the message constants of ``MotionResult`` mirror these names."""

    UNKNOWN_MOTION = "unknown_motion"
    INVALID_REQUEST = "invalid_request"
    OUT_OF_REACH = "out_of_reach"
    NO_SOLUTION = "no_solution"
    CHECK_FAILED = "check_failed"
    BUSY = "busy"
    WRONG_ROBOT = "wrong_robot"
    INVALID_PLAN = "invalid_plan"
    START_MISMATCH = "start_mismatch"
    NOT_STANDING = "not_standing"
    FELL = "fell"
    TIMEOUT = "timeout"
    INTERNAL = "internal"
    STOPPED = "stopped"


class RefusalError(AerialError):
    """A goal or plan is refused: a code for programs, a sentence that names what binds for people."""

    def __init__(self, code: RefusalCode, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason
        self.report: Any = None  # figures of the refused request, where the one who refuses has some
