"""Which trial points of a line search are accepted: those that a filter of violation and cost does not forbid.

Numbers in brackets are equations of Wächter and Biegler (2006), whom ``interior_point`` cites in full.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

_THETA_MARGIN, _PHI_MARGIN = 1e-5, 1e-8  # γ_θ, γ_φ of (18)
_ARMIJO, _SWITCH_THETA, _SWITCH_PHI = 1e-8, 1.1, 2.3  # η_φ, s_θ, s_φ of (19), (20)
_THETA_LEAST, _THETA_MOST = 1e-4, 1e4  # of the first violation: below, descent decides; above, nothing is accepted
_ROUNDING = 10 * sys.float_info.epsilon  # what comparisons of large sums must forgive, as a share


class Merit(NamedTuple):
    """The two measures of a point that compete."""

    theta: float  # violation of all constraints, summed
    phi: float  # cost and barrier


class Filter:
    """Pairs (θ, φ) of which a trial must be better than one entry each.

    Args:
        theta: violation where the iteration begins.
    """

    def __init__(self, theta: float) -> None:
        self._theta_least, self._theta_most = max(1.0, theta) * _THETA_LEAST, max(1.0, theta) * _THETA_MOST
        self._entries: list[Merit] = []

    def clear(self) -> None:
        """Forget all entries: φ of another barrier parameter compares with none of them."""
        self._entries = []

    def accepts(self, trial: Merit, present: Merit, length: float, descent: float) -> bool:
        """Return whether a trial is acceptable to the filter and from the present point, which may become an entry.

        Args:
            trial: the point to step to.
            present: the point to step from.
            length: share of the full step, α.
            descent: directional derivative of φ along the full step.
        """
        theta, phi = present
        if not (np.isfinite(trial.theta) and np.isfinite(trial.phi)) or trial.theta > self._theta_most:
            return False
        if any(trial.theta >= entry.theta and trial.phi >= entry.phi for entry in self._entries):
            return False
        change = trial.phi - phi - _ROUNDING * abs(phi)
        descends = descent < 0.0 and length * (-descent) ** _SWITCH_PHI > theta**_SWITCH_THETA  # (19)
        falls_enough = change <= _ARMIJO * length * descent  # (20)
        if descends and theta <= self._theta_least:
            return falls_enough
        if trial.theta > (1 - _THETA_MARGIN) * theta and change > -_PHI_MARGIN * theta:  # (18)
            return False
        if not (descends and falls_enough):
            self._entries.append(Merit((1 - _THETA_MARGIN) * theta, phi - _PHI_MARGIN * theta))  # (22)
        return True
