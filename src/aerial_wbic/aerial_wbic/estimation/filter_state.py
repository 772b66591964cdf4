"""What the Kalman filter carries from one measurement to the next; the equations are in ``estimator``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.numerics.layout import Layout

P, V, FEET = 0, 1, 2  # rows of X; the contact points fill it from FEET on


class FilterState(NamedTuple):
    """Estimate and covariance; its arrays change in place. All of it lies in one block."""

    orientation: np.ndarray  # of B (4,)
    angular_velocity: np.ndarray  # of B in B, as last measured (3,) [rad/s]
    X: np.ndarray  # (2 + n_c, 3)
    P: np.ndarray  # (2 + n_c, 2 + n_c)
    roll: np.ndarray  # u_i of the loaded points, else zero (n_c, 3) [m/s]
    loaded_since: np.ndarray  # (n_c,) [s]
    block: np.ndarray  # what all these arrays lie in


FILTER_STATE = Layout(
    sizes=("n_c",),
    arrays={
        "orientation": (4,),
        "angular_velocity": (3,),
        "X": (f"{FEET} + n_c", 3),
        "P": (f"{FEET} + n_c", f"{FEET} + n_c"),
        "roll": ("n_c", 3),
        "loaded_since": ("n_c",),
    },
)
filter_state_in = FILTER_STATE.reader(FilterState)


def initial_filter_state(orientation: np.ndarray, angular_velocity: np.ndarray, n_c: int) -> FilterState:
    """Return the state of a filter that knows attitude ``(4,)`` and angular velocity ``(3,)`` and nothing else yet."""
    filter_state = filter_state_in(FILTER_STATE.block(n_c=n_c))
    filter_state.orientation[:] = orientation
    filter_state.angular_velocity[:] = angular_velocity
    filter_state.loaded_since[:] = -np.inf  # a robot that is switched on stands firmly
    return filter_state
