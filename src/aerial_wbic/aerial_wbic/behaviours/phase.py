"""What the controller reports to be doing: fewer and older words than its behaviours, each of which is of one phase or two."""

from __future__ import annotations

from enum import IntEnum


class Phase(IntEnum):
    """What the controller is doing; the numbers are those of ``ControllerStatus``."""

    LIE = 0  # on its way to the ground or on it; joints damped in the end
    STAND = 1  # balanced on all contact points; takes plans
    TAKE_OFF = 2  # on the ground, following a plan
    FLIGHT = 3  # no contact planned
    LANDING = 4  # touched down or getting up, coming to rest
    STOPPED = 5  # emergency stop, until reset


FOLLOWING = (Phase.TAKE_OFF, Phase.FLIGHT)  # a plan gives the target
