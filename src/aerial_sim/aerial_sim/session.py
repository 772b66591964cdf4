"""The exchange between the robot's stand-in and its controller: states out, commands in, and what if none comes."""

from __future__ import annotations

import numpy as np

from aerial_model.robot import Robot
from aerial_model.state import Command, Measurement
from aerial_sim.simulation import Simulation

HOLD_TICKS = 5  # periods for which the drives keep an old command before they only damp
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
        self._silent_ticks = 0
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
        return self._command is not None and self._command.state_sequence == self.measurement.sequence

    @property
    def free(self) -> bool:
        """Whether time may go on."""
        return self.started and self.awaited is None and (not self.paused or self.granted > 0)

    def offer(self, command: Command) -> None:
        """Take a command, unless it answers an older state than the last one did."""
        if self._command is None or command.state_sequence >= self._command.state_sequence:
            self._command = command

    def advance(self) -> Measurement:
        """Let one control period pass and return the state after it.

        Without an answer to the present state the drives keep the last command, for ``HOLD_TICKS`` periods.
        """
        self._silent_ticks = 0 if self.answered else self._silent_ticks + 1
        self.ticks += 1
        self.missed_ticks += self._silent_ticks > 0
        self.granted = max(self.granted - 1, 0) if self.paused else 0
        held = self._command if self._silent_ticks <= HOLD_TICKS else self._limp
        return self.simulation.step(held or self._limp)

    def reset(self, seed: int) -> Measurement:
        """Begin anew and wait for a first command; a pause stays."""
        self.ticks = self.missed_ticks = self.granted = self._silent_ticks = 0
        self.awaited = self._command = None
        return self.simulation.reset(seed)


def _damping(robot: Robot) -> Command:
    zero = np.zeros(robot.n_joints)
    return Command(torque=zero, position=zero, velocity=zero, stiffness=zero, damping=zero + SILENCE_DAMPING)
