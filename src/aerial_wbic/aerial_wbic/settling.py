"""A smooth way from one state of motion to rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.compiled import compiled

REACH = 0.84  # how far a settling from its end goes, per ẋ_0 / ω
TIME = 8.0  # after which 99 % of an offset is gone, per 1 / ω


class Settling(NamedTuple):
    """The response of three equal poles from (x_0, ẋ_0, ẍ_0 = 0) to rest at x_f: it brakes early and returns slowly.

    From x_0 = x_f it goes 0.84 ẋ_0 / ω far, brakes with 0.80 ẋ_0 ω at most, and swings back with at most 0.08 ẋ_0 ω.
    """

    rate: np.ndarray  # ω of the poles (m,) [1/s]
    c_0: np.ndarray  # (c_0 + c_1 u + c_2 u²) exp(−u) with u = ω t, each (m,)
    c_1: np.ndarray
    c_2: np.ndarray
    x_f: np.ndarray  # end (m,)


def settling(x_0: np.ndarray, xdot_0: np.ndarray, x_f: np.ndarray, rate: np.ndarray | float) -> Settling:
    """Return the way from a state of motion to rest.

    Args:
        x_0: start ``(m,)``.
        xdot_0: rate at the start ``(m,)``.
        x_f: end ``(m,)``.
        rate: ω of the poles [1/s], positive, one or ``(m,)``.
    """
    offset, run = x_0 - x_f, xdot_0 / rate
    return Settling(
        rate=np.broadcast_to(rate, offset.shape).astype(float),
        c_0=offset,
        c_1=run + offset,
        c_2=run + offset / 2,
        x_f=np.array(x_f),
    )


@compiled
def settled(way: Settling, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, ẋ and ẍ ``(m,)`` at ``time`` [s] after the start."""
    u = way.rate * time
    decay = np.exp(-u)
    x = way.c_0 + (way.c_1 + way.c_2 * u) * u
    slope = way.c_1 + 2 * way.c_2 * u - x  # in u, before the decay
    curvature = 2 * way.c_2 - (way.c_1 + 2 * way.c_2 * u) - slope
    return way.x_f + x * decay, slope * decay * way.rate, curvature * decay * way.rate**2
