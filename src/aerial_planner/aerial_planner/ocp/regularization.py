"""How much of the identity is added to a Hessian whose reduced form is not positive definite.

Algorithm IC of Wächter and Biegler (2006), whom ``interior_point`` cites in full, without δ_c: redundant constraints do not
disturb the Riccati recursion.
"""

from __future__ import annotations

from dataclasses import dataclass

_FIRST, _LEAST, _MOST = 1e-4, 1e-20, 1e10  # δ_w^0, δ_w^min, δ_w^max
_UP_FIRST, _UP, _DOWN = 100.0, 8.0, 1 / 3  # κ̄_w⁺, κ_w⁺, κ_w⁻
_TRIED = 1e6  # δ_w up to which a step that the filter does not accept is tried again with more


@dataclass
class Regularization:
    """The multiple δ_w of the identity, from one step to the next."""

    last: float = 0.0  # that was needed last, 0 if none ever was

    def more(self, delta: float) -> float | None:
        """Return the next δ_w to try after ``delta`` was too little for a minimum; None if it would be too much."""
        if delta == 0.0:
            following = _FIRST if self.last == 0.0 else max(_LEAST, _DOWN * self.last)
        else:
            following = delta * (_UP_FIRST if self.last == 0.0 else _UP)
        return None if following > _MOST else following

    def after_rejection(self) -> float | None:
        """Return the δ_w of a shorter, steeper step where the filter accepted none; None if it would be too much."""
        self.last = max(_FIRST, _UP * self.last)
        return None if self.last > _TRIED else self.last
