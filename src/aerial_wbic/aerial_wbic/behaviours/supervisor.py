"""Which behaviour runs, and the one table that says which may follow it on what event.

A new behaviour (a gait, a recovery, a controlled fall) is a class beside the others and its rows in ``TRANSITIONS``.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

import numpy as np

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.kinematics import Configuration
from aerial_model.values.plan import Plan
from aerial_wbic.behaviours.behaviour import Behaviour, Entry, Event, PlanRun, Setting
from aerial_wbic.behaviours.follow_plan import FollowPlan
from aerial_wbic.behaviours.land import Land
from aerial_wbic.behaviours.lie import Fold, Lie, Sink
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.behaviours.stand import Stand
from aerial_wbic.behaviours.stopped import Stopped
from aerial_wbic.target import PostureTarget, WholeBodyTarget


class Condition(StrEnum):
    """What has to hold for what is asked for to be done."""

    ON_ALL_POINTS = "every contact point is planned to bear load"
    UPRIGHT = "the trunk is not tilted too far"


class Transition(NamedTuple):
    """One row of the table: any of some behaviours, the event that ends it, and what follows."""

    behaviours: tuple[type[Behaviour], ...]
    event: Event
    follower: type[Behaviour]
    condition: Condition | None = None


EVERY: tuple[type[Behaviour], ...] = (Stand, FollowPlan, Land, Sink, Lie, Fold, Stopped)

TRANSITIONS = (
    Transition((Stand,), Event.PLAN_ACCEPTED, FollowPlan),
    Transition((FollowPlan,), Event.TOUCHDOWN, Land),
    Transition((FollowPlan,), Event.ABORT, Land, Condition.ON_ALL_POINTS),
    Transition((Land,), Event.REST_REACHED, Stand),
    Transition((Land,), Event.REST_NOT_REACHED, Lie),
    Transition((Stand,), Event.LIE_DOWN, Sink),
    Transition((Sink,), Event.SUNK, Lie),
    Transition((Stand, Land, Sink), Event.TILTED, Lie),
    Transition((Lie,), Event.STAND_UP, Fold, Condition.UPRIGHT),
    Transition((Fold,), Event.FOLDED, Land),
    Transition(EVERY, Event.STOP, Stopped),
    Transition(EVERY, Event.RESET, Stand),
)

_ROWS = {(behaviour, row.event): row for row in TRANSITIONS for behaviour in row.behaviours}

# Why what is asked for is refused where the table has no row for it.
_REFUSALS = {
    Event.PLAN_ACCEPTED: (RefusalCode.NOT_STANDING, "the robot does not stand"),
    Event.ABORT: (RefusalCode.INVALID_REQUEST, "nothing to abort on the ground"),
    Event.LIE_DOWN: (RefusalCode.NOT_STANDING, "to lie down it must stand"),
    Event.STAND_UP: (RefusalCode.INVALID_REQUEST, "to stand up it must lie"),
}
# And where a row's condition does not hold.
_UNMET = {
    Condition.ON_ALL_POINTS: (RefusalCode.BUSY, "too late to abort: a foot has left the ground"),
    Condition.UPRIGHT: (RefusalCode.FELL, "the robot lies on its side or back: set it on its belly first"),
}


class Supervisor:
    """Runs one behaviour after the other, as the table has it; it stands first.

    A tick calls ``advance`` before its estimate and ``observe`` after it; each applies at most one event.

    Args:
        setting: of the robot.
    """

    def __init__(self, setting: Setting) -> None:
        self._setting = setting
        self._behaviour: Behaviour = Stand(setting, Entry(Event.RESET))
        self._is_new = True  # it has not started from a state yet
        self.reset()

    def reset(self) -> None:
        """Stand from the next tick on, wherever the robot is then; nothing is remembered."""
        self._time = 0.0  # of the last tick [s]
        self._state: Configuration | None = None  # in the last tick
        self._enter(self.check(Event.RESET).follower, Entry(Event.RESET))

    # --- what it tells -----------------------------------------------------------------------------------------------

    @property
    def behaviour(self) -> Behaviour:
        """The one that runs."""
        return self._behaviour

    @property
    def phase(self) -> Phase:
        """Phase of the behaviour that runs, as ``ControllerStatus`` reports it."""
        return self._behaviour.phase(self._time)

    @property
    def plan_run(self) -> PlanRun | None:
        """The plan that is carried out: followed, or landed from."""
        return self._behaviour.plan_run

    @property
    def time_in_plan(self) -> float:
        """Time since the plan that is carried out began [s]; 0 when none is."""
        run = self._behaviour.plan_run
        return 0.0 if run is None else run.time(self._time)

    @property
    def contact(self) -> np.ndarray:
        """The points that carry load now, by the schedule ``(n_c,)`` bool."""
        return self._behaviour.contact(self._time)

    def target(self, state: Configuration) -> WholeBodyTarget | PostureTarget | None:
        """Return what a robot at ``state`` is to do now; None: nothing but to damp the joints."""
        return self._behaviour.target(self._time, state)

    # --- what it is asked for, between two ticks ---------------------------------------------------------------------

    def check(self, event: Event) -> Transition:
        """Return what follows if ``event`` is asked for now.

        Raises:
            RefusalError: if the table has no row for it, or the row's condition does not hold.
        """
        row = _ROWS.get((type(self._behaviour), event))
        if row is None:
            raise self._refusal(event)
        if row.condition is not None and not self._holds(row.condition):
            raise RefusalError(*_UNMET[row.condition])
        return row

    def ask(self, event: Event, plan: Plan | None = None) -> None:
        """Do what is asked for, from the next tick on.

        Args:
            event: that is asked for.
            plan: to follow, in W, for ``PLAN_ACCEPTED``.

        Raises:
            RefusalError: as of ``check``.
        """
        self._enter(self.check(event).follower, Entry(event, self._behaviour, plan))

    # --- a tick ------------------------------------------------------------------------------------------------------

    def advance(self, time: float, touching: np.ndarray) -> None:
        """Advance to ``time`` [s], before the estimate: a new behaviour begins, a scheduled event is applied.

        Args:
            time: of the tick [s].
            touching: points that were felt to bear load in the tick before ``(n_c,)`` bool.
        """
        self._time = time
        if self._is_new:
            self._behaviour.begin(time)
        event = self._behaviour.scheduled(time, touching)
        if event is not None:
            self._apply(event)

    def observe(self, state: Configuration) -> None:
        """Take note of the estimated state: a new behaviour starts from it, an event it shows is applied."""
        self._state = state
        self._start(state)
        event = self._behaviour.observed(self._time, state)
        if event is not None:
            self._apply(event)
            self._start(state)

    def _start(self, state: Configuration) -> None:
        if self._is_new:
            self._behaviour.start_from(self._time, state)
            self._is_new = False

    def _apply(self, event: Event) -> None:
        """Go on to what follows on an event of a tick, and begin it."""
        self._enter(_ROWS[type(self._behaviour), event].follower, Entry(event, self._behaviour))
        self._behaviour.begin(self._time)

    def _enter(self, behaviour: type[Behaviour], entry: Entry) -> None:
        self._behaviour = behaviour(self._setting, entry)
        self._is_new = True

    # --- what is refused ---------------------------------------------------------------------------------------------

    def _holds(self, condition: Condition) -> bool:
        if condition is Condition.ON_ALL_POINTS:
            return bool(self.contact.all())
        return self._state is None or bool(self._state.R_WB[2, 2] >= self._setting.upright_min)

    def _refusal(self, event: Event) -> RefusalError:
        run = self._behaviour.plan_run
        if isinstance(self._behaviour, Stopped):
            return RefusalError(RefusalCode.STOPPED, "an emergency stop holds: reset the controller first")
        if event is Event.PLAN_ACCEPTED and run is not None:
            return RefusalError(RefusalCode.BUSY, f"motion '{run.plan.motion}' still runs")
        code, sentence = _REFUSALS[event]
        return RefusalError(code, f"{sentence}: its phase is {self.phase.name}")


def transition_table() -> str:
    """Return the transitions as a Markdown table, as docs/architecture.md has it."""
    lines = ["| behaviour | event | followed by | if |", "|---|---|---|---|"]
    for row in TRANSITIONS:
        names = "any" if row.behaviours == EVERY else ", ".join(behaviour.name for behaviour in row.behaviours)
        condition = "" if row.condition is None else row.condition
        lines.append(f"| {names} | {row.event} | {row.follower.name} | {condition} |")
    return "\n".join(lines)
