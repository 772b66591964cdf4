"""The motor boards' watchdog: they keep the newest command, and only damp the joints once it is too old."""

from __future__ import annotations

import numpy as np

from aerial_model.values.command import Command

HOLD_PERIODS = 5  # control periods by which a command may be late before the joints are only damped
SILENCE_DAMPING = 2.0  # of every joint then, as motor boards do by themselves [N·m·s/rad]


class Watchdog:
    """Keeps the newest command for as long as it may act.

    Args:
        n_joints: of the robot.
    """

    def __init__(self, n_joints: int) -> None:
        zero = np.zeros(n_joints)
        self._damping = Command(
            torque=zero, position=zero, velocity=zero, stiffness=zero, damping=zero + SILENCE_DAMPING
        )
        self._newest: Command | None = None

    def offer(self, command: Command, sequence: int) -> None:
        """Take a command, unless a newer one came before, or it answers a state later than the present one.

        Args:
            command: that came; one that answers a later state is from before a reset.
            sequence: number of the present state.
        """
        newest = -1 if self._newest is None else self._newest.state_sequence
        if newest <= command.state_sequence <= sequence:
            self._newest = command

    def clear(self) -> None:
        """Forget every command."""
        self._newest = None

    @property
    def fed(self) -> bool:
        """Whether a command ever came."""
        return self._newest is not None

    def age(self, sequence: int) -> int | None:
        """Return how many states before state number ``sequence`` the newest command was due; None if there is none."""
        return None if self._newest is None else sequence - self._newest.state_sequence

    def in_force(self, sequence: int) -> Command:
        """Return what the motor boards obey in the control period after state number ``sequence``."""
        if self._newest is None or sequence - self._newest.state_sequence > HOLD_PERIODS:
            return self._damping
        return self._newest
