"""The exchange between the simulated robot and its controller: a state out, a command in, a control period passes."""

from __future__ import annotations

from aerial_model.values.command import Command
from aerial_model.values.measurement import Measurement
from aerial_sim.robot_side.watchdog import Watchdog
from aerial_sim.simulation import Simulation


class Exchange:
    """Advances a simulation by the commands that answer its states, and counts those that came too late.

    Time stands still until the first command, while paused, and while a plan is waited for.

    Args:
        simulation: of the robot that is commanded.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.paused = False
        self.awaited: str | None = None  # request whose plan time waits for
        self.ticks = 0  # since the last reset
        self.missed_ticks = 0  # of them, those whose command was not there in time
        self.granted = 0  # periods that may still pass in spite of a pause
        self._watchdog = Watchdog(simulation.robot.n_joints)

    @property
    def measurement(self) -> Measurement:
        """The state that wants an answer."""
        return self.simulation.measure()

    @property
    def started(self) -> bool:
        """Whether a command ever came."""
        return self._watchdog.fed

    @property
    def answered(self) -> bool:
        """Whether the command for the present state is there."""
        return self._watchdog.age(self.measurement.sequence) == 0

    @property
    def free(self) -> bool:
        """Whether time may go on."""
        return self.started and self.awaited is None and (not self.paused or self.granted > 0)

    def offer(self, command: Command) -> None:
        """Hand a command to the motor boards; one that was overtaken, or is from before a reset, has no effect."""
        self._watchdog.offer(command, self.measurement.sequence)

    def advance(self) -> Measurement:
        """Advance by one control period under the command in force, and return the state after it."""
        self.ticks += 1
        self.missed_ticks += not self.answered
        self.granted = max(self.granted - 1, 0) if self.paused else 0
        return self.simulation.step(self._watchdog.in_force(self.measurement.sequence))

    def reset(self, seed: int) -> Measurement:
        """Begin anew and wait for a first command; a pause stays."""
        self.ticks = self.missed_ticks = self.granted = 0
        self.awaited = None
        self._watchdog.clear()
        return self.simulation.reset(seed)
