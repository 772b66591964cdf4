"""What every behaviour answers, the events that end one, and what one is made from.

A behaviour is entered by an event, begins with the next tick at the latest, and runs until an event that the transition
table (``supervisor``) has for it. What it is asked while it runs changes nothing in it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from aerial_model.kinematics import Configuration
from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Plan
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.gains import ControllerGains
from aerial_wbic.target import PostureTarget, WholeBodyTarget


class Event(StrEnum):
    """What can end a behaviour."""

    # Asked for, between two ticks.
    PLAN_ACCEPTED = "plan accepted"
    ABORT = "abort"
    LIE_DOWN = "lie down"
    STAND_UP = "stand up"
    STOP = "emergency stop"
    RESET = "reset"
    # Scheduled: raised before a tick's estimate, which trusts the contacts of the behaviour that runs then.
    TOUCHDOWN = "touchdown"
    # Observed: raised after a tick's estimate.
    REST_REACHED = "rest reached"
    REST_NOT_REACHED = "rest not reached"
    TILTED = "tilted too far"
    SUNK = "sunk to the ground"
    FOLDED = "legs folded"


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What all behaviours of one robot share."""

    robot: Robot
    gains: ControllerGains
    home_height: float  # of the centre of mass above the ground, to stand at until a plan says otherwise [m]

    @cached_property
    def upright_min(self) -> float:
        """Vertical part of the base's z axis below which the robot has tilted too far."""
        return float(np.cos(self.gains.fall_tilt))

    @cached_property
    def all_points(self) -> np.ndarray:
        """The contacts of a robot that stands ``(n_c,)``."""
        return np.ones(self.robot.n_contacts, dtype=bool)

    @cached_property
    def no_point(self) -> np.ndarray:
        """The contacts of a robot in the air ``(n_c,)``."""
        return np.zeros(self.robot.n_contacts, dtype=bool)


@dataclass
class PlanRun:
    """A plan that is carried out: followed, or landed from."""

    plan: Plan  # in W
    begin: float | None = None  # [s]; None until the tick that begins it

    def time(self, now: float) -> float:
        """Return the time since the plan began [s]; 0 before it does."""
        return 0.0 if self.begin is None else now - self.begin


class Entry(NamedTuple):
    """How a behaviour comes to run."""

    event: Event
    before: Behaviour | None = None  # which the event ended; None after a reset: nothing is remembered
    plan: Plan | None = None  # that was accepted, in W


class Behaviour(ABC):
    """What the robot does until an event ends it.

    Args:
        setting: of the robot.
        entry: how it comes to run.
    """

    name: ClassVar[str]
    settled: ClassVar[bool] = False  # whether nothing is under way

    def __init__(self, setting: Setting, entry: Entry) -> None:
        self._setting = setting
        # Of the centre of mass above the ground, the next time the robot stands [m].
        self.com_height: float = setting.home_height if entry.before is None else entry.before.com_height
        self.plan_run: PlanRun | None = None  # that is carried out

    def begin(self, time: float) -> None:  # noqa: B027 (most have nothing to do)
        """Begin at ``time`` [s]; called once, before the behaviour is asked anything of that time."""

    def start_from(self, time: float, state: Configuration) -> None:  # noqa: B027
        """Begin from the state the robot is in; called once, in the tick of ``begin``, after the estimate."""

    @abstractmethod
    def phase(self, time: float) -> Phase:
        """Return what is reported at ``time`` [s]."""

    def contact(self, time: float) -> np.ndarray:
        """Return the points that carry load at ``time`` [s], by the schedule ``(n_c,)`` bool."""
        return self._setting.all_points

    def scheduled(self, time: float, touching: np.ndarray) -> Event | None:
        """Return the event that is due at ``time`` [s], before the estimate.

        Args:
            time: of the tick [s].
            touching: points that were felt to bear load in the tick before ``(n_c,)`` bool.
        """
        return None

    def observed(self, time: float, state: Configuration) -> Event | None:
        """Return the event that a robot at ``state`` shows at ``time`` [s]."""
        return None

    @abstractmethod
    def target(self, time: float, state: Configuration) -> WholeBodyTarget | PostureTarget | None:
        """Return what a robot at ``state`` is to do at ``time`` [s], until the next is asked for; None: damp its joints."""
