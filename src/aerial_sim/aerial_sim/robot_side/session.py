"""The exchange between the robot's stand-in and its controller: states out, commands in, and what if none comes."""

from __future__ import annotations

import numpy as np

from aerial_model.robot.robot import Robot
from aerial_model.values.command import Command
from aerial_model.values.measurement import Measurement
from aerial_sim.simulation import Simulation

HOLD_TICKS = 5  # periods by which a command may be late before the drives only damp
SILENCE_DAMPING = 2.0  # of every joint then, as motor boards do by themselves [N·m·s/rad]


class Session:
    """Advances a simulation by the commands that answer its states, and counts those that came too late.

    Time stands still until the first command, while paused, and while a plan is waited for.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.paused = False
        self.awaited: str | None = None  # request whose plan time waits for
        self.ticks = 0  # since the last reset
        self.missed_ticks = 0  # of them, those whose command was not there in time
        self.granted = 0  # periods that may still pass in spite of a pause
        self._command: Command | None = None
        self._limp = _damping(simulation.robot)

    @property
    def measurement(self) -> Measurement:
        """The state that wants an answer."""
        return self.simulation.measure()

    @property
    def started(self) -> bool:
        """Whether a command ever came."""
        return self._command is not None

    @property
    def answered(self) -> bool:
        """Whether the command for the present state is there."""
        return self._command is not None and self._age == 0

    @property
    def _age(self) -> int:
        """How many states ago the newest command was due."""
        return self.measurement.sequence - self._command.state_sequence

    @property
    def free(self) -> bool:
        """Whether time may go on."""
        return self.started and self.awaited is None and (not self.paused or self.granted > 0)

    def offer(self, command: Command) -> None:
        """Take a command, unless a newer one came before it, or it answers a state from before a reset."""
        newest = -1 if self._command is None else self._command.state_sequence
        if newest <= command.state_sequence <= self.measurement.sequence:
            self._command = command

    def advance(self) -> Measurement:
        """Let one control period pass and return the state after it.

        The drives keep the newest command until it is older than ``HOLD_TICKS`` periods.
        """
        self.ticks += 1
        self.missed_ticks += not self.answered
        self.granted = max(self.granted - 1, 0) if self.paused else 0
        fresh = self._command is not None and self._age <= HOLD_TICKS
        return self.simulation.step(self._command if fresh else self._limp)

    def reset(self, seed: int) -> Measurement:
        """Begin anew and wait for a first command; a pause stays."""
        self.ticks = self.missed_ticks = self.granted = 0
        self.awaited = self._command = None
        return self.simulation.reset(seed)


def _damping(robot: Robot) -> Command:
    zero = np.zeros(robot.n_joints)
    return Command(torque=zero, position=zero, velocity=zero, stiffness=zero, damping=zero + SILENCE_DAMPING)
