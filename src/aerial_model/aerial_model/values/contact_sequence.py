"""Which contact points bear load where and for how long: the contacts of a take-off today, of a gait tomorrow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

INSTANT = 1e-9  # by which times that are meant to be equal differ, since durations are summed [s]
FOOTHOLD_TOLERANCE = 1e-9  # by which a point may move from one phase to the next while it bears load [m]


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactPhase:
    """A time in which the same contact points bear load at the same footholds."""

    duration: float  # [s]
    contact: np.ndarray  # (n_c,) bool, the points that bear load
    foothold: np.ndarray  # (n_c, 3) where the centre of each point's sphere is while it bears load [m]

    def __post_init__(self) -> None:
        n_c = len(self.contact)
        if not 0 < self.duration < np.inf:
            raise ValueError(f"contact phase: expected a positive duration, found {self.duration}")
        if np.shape(self.foothold) != (n_c, 3):
            raise ValueError(f"contact phase: expected footholds of shape {(n_c, 3)}, found {np.shape(self.foothold)}")


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactSequence:
    """Contact phases that follow each other, with footholds in one frame; a phase without contacts is a flight.

    Raises:
        ValueError: if there is no phase, their points differ in number, or a point moves while it bears load.
    """

    phases: tuple[ContactPhase, ...]

    def __post_init__(self) -> None:
        if not self.phases:
            raise ValueError("contact sequence: expected at least one phase, found none")
        for before, after in zip(self.phases[:-1], self.phases[1:], strict=True):
            if len(before.contact) != len(after.contact):
                raise ValueError(
                    f"contact sequence: expected {len(before.contact)} points in all phases, found {len(after.contact)}"
                )
            both = before.contact & after.contact
            moved = np.linalg.norm(after.foothold[both] - before.foothold[both], axis=1)
            if np.any(moved > FOOTHOLD_TOLERANCE):
                raise ValueError(f"contact sequence: a point moves by {moved.max():.3g} m while it bears load")

    @property
    def duration(self) -> float:
        """Time from the beginning of the first phase to the end of the last [s]."""
        return float(sum(phase.duration for phase in self.phases))

    def index(self, time: float) -> int:
        """Return the number of the phase at ``time`` [s] after the beginning; before and after the sequence: its ends."""
        ends = np.cumsum([phase.duration for phase in self.phases])
        return min(int(np.searchsorted(ends, time + INSTANT, side="right")), len(self.phases) - 1)

    def at(self, time: float) -> ContactPhase:
        """Return the phase at ``time`` [s] after the beginning; before and after the sequence: its ends."""
        return self.phases[self.index(time)]
