"""The emergency stop: it holds until a reset."""

from __future__ import annotations

from aerial_model.kinematics import Configuration
from aerial_wbic.behaviours.behaviour import Behaviour
from aerial_wbic.behaviours.phase import Phase


class Stopped(Behaviour):
    """Damps the joints, whatever happens."""

    name = "stopped"
    settled = True

    def phase(self, time: float) -> Phase:
        """Return STOPPED."""
        return Phase.STOPPED

    def target(self, time: float, state: Configuration) -> None:
        """Return nothing: the joints are only damped."""
        return
