"""To come to rest over the feet: after a touchdown, after a motion that was called off, and from folded legs."""

from __future__ import annotations

from aerial_model.kinematics import Configuration
from aerial_wbic.behaviours.behaviour import Entry, Event, Setting
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.behaviours.rest import Resting, rest_target


class Land(Resting):
    """Comes to rest: at the height the plan says after its touchdown, else at the one the robot stood at last."""

    name = "land"

    def __init__(self, setting: Setting, entry: Entry) -> None:
        super().__init__(setting, entry)
        if entry.event is Event.TOUCHDOWN and entry.before is not None and entry.before.plan_run is not None:
            self.plan_run = entry.before.plan_run
            self.com_height = self.plan_run.plan.landing_com_height

    def start_from(self, time: float, state: Configuration) -> None:
        """Catch the motion that the robot has."""
        self._rest = rest_target(self._setting, time, state, self.com_height, self._setting.gains.settling_rate)

    def phase(self, time: float) -> Phase:
        """Return LANDING."""
        return Phase.LANDING

    def observed(self, time: float, state: Configuration) -> Event | None:
        """Return whether rest is reached, when it should be; TILTED before all else."""
        event = super().observed(time, state)
        if event is None and time >= self.rest.end:
            return Event.REST_REACHED if self.rest.reached(state) else Event.REST_NOT_REACHED
        return event
