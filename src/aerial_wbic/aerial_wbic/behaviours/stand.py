"""To stand, balanced on all contact points."""

from __future__ import annotations

from aerial_model.kinematics import Configuration
from aerial_wbic.behaviours.behaviour import Entry, Setting
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.behaviours.rest import Resting, rest_target


class Stand(Resting):
    """Stands where it has come to rest, or from where it is after a reset; takes plans."""

    name = "stand"
    settled = True

    def __init__(self, setting: Setting, entry: Entry) -> None:
        super().__init__(setting, entry)
        if isinstance(entry.before, Resting):
            self._rest = entry.before.rest  # it goes on: a trajectory to rest has no end

    def start_from(self, time: float, state: Configuration) -> None:
        """Come to rest from where the robot is, unless it has."""
        if self._rest is None:
            self._rest = rest_target(self._setting, time, state, self.com_height, self._setting.gains.settling_rate)

    def phase(self, time: float) -> Phase:
        """Return STAND."""
        return Phase.STAND
