"""Contact points of the take-off knots: held since the knot before, loaded from here on, or arriving; and where they stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerial_planner.motion.schedule import Schedule, contact_bits
from aerial_planner.reference.body import Reference

Contacts = tuple[bool, ...]


@dataclass(frozen=True, kw_only=True)
class KnotContacts:
    """The contact points of one take-off knot, a flag each.

    A point that comes to the ground rests at its foothold through the interval before it bears load: rates are constant
    on each interval, so that its velocity at the knot where the contact begins is zero from both sides.
    """

    held: Contacts | None  # bore load on the interval before; None at the first knot, whose state is fixed
    loaded: Contacts  # bear load on the interval that begins here
    arriving: Contacts  # in the air on the interval before, rest on the one that begins here, then bear load

    @property
    def at_foothold(self) -> Contacts:
        """Points whose position is their foothold's."""
        held = self.held or (False,) * len(self.loaded)
        return tuple(any(flags) for flags in zip(held, self.loaded, self.arriving, strict=True))

    @property
    def name(self) -> str:
        """The sets as part of a name."""
        name = f"{contact_bits(self.held)}_{contact_bits(self.loaded)}"
        return f"{name}_{contact_bits(self.arriving)}" if any(self.arriving) else name


def knot_contacts(schedule: Schedule) -> list[KnotContacts]:
    """Return the contacts of each of the N take-off knots."""
    held, loaded, arriving = _before(schedule), schedule.contact, _arriving(schedule)
    return [
        KnotContacts(
            held=None if k == 0 else _flags(held[k]),
            loaded=_flags(loaded[k]),
            arriving=_flags(arriving[k]),
        )
        for k in range(len(loaded))
    ]


def footholds(schedule: Schedule, reference: Reference) -> np.ndarray:
    """Return where points on the ground stand and, in z, above which height those in the air must be ``(N+1, n_c, 3)`` [m].

    A point that leaves the ground at a knot is there still at the foothold it leaves, one that arrives already at the next.
    """
    loaded, arriving = schedule.contact, _arriving(schedule)
    at = reference.foot_position.copy()
    at[1:][loaded] = reference.foot_position[:-1][loaded]
    at[:-1][loaded] = reference.foot_position[:-1][loaded]
    at[:-1][arriving[:-1]] = reference.foot_position[1:][arriving[:-1]]
    on_ground = _before(schedule) | arriving
    on_ground[:-1] |= loaded
    at[..., 2] += np.where(on_ground, 0.0, reference.foot_clearance)
    return at


def _before(schedule: Schedule) -> np.ndarray:
    """Return which points bear load on the interval before each knot ``(N+1, n_c)``."""
    return np.vstack([np.zeros_like(schedule.contact[:1]), schedule.contact])


def _arriving(schedule: Schedule) -> np.ndarray:
    """Return which points come to rest at each knot to bear load from the next on ``(N+1, n_c)``; the first knot is fixed."""
    contact = schedule.contact
    arriving = np.zeros((len(contact) + 1, contact.shape[1]), dtype=bool)
    arriving[1:-2] = ~contact[:-2] & ~contact[1:-1] & contact[2:]
    return arriving


def _flags(row: np.ndarray) -> Contacts:
    return tuple(bool(on) for on in row)
