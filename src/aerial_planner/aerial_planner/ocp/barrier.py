"""The logarithmic barrier of bounded slacks, and the multipliers of their bounds.

    φ(s) = −μ Σ_i [ln(s_i − l_i) + ln(u_i − s_i)] ,   z_l (s − l) = z_u (u − s) = μ on the central path

Each function is one pass over all slacks. Numbers in brackets are equations of Wächter and Biegler (2006), whom
``interior_point`` cites in full.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.numerics.jit import compiled

_DUAL_RANGE = 1e10  # κ_Σ of (16)
_PRODUCT_LEAST, _PRODUCT_MOST = (
    1e-150,
    1e150,
)  # of distances, before its logarithm is taken: the next may not overflow it


class Bounds(NamedTuple):
    """Bounds of m slacks; 0 where there is none."""

    low: np.ndarray  # (m,)
    high: np.ndarray  # (m,)
    has_low: np.ndarray  # (m,) bool
    has_high: np.ndarray  # (m,) bool

    @staticmethod
    def of(low: np.ndarray, high: np.ndarray) -> Bounds:
        """Return the bounds that are given ``(m,)``, infinite where there is none."""
        has_low, has_high = np.isfinite(low), np.isfinite(high)
        return Bounds(np.where(has_low, low, 0.0), np.where(has_high, high, 0.0), has_low, has_high)

    @property
    def n_finite(self) -> int:
        """Number of bounds."""
        return int(self.has_low.sum() + self.has_high.sum())

    def interior(self, s: np.ndarray, push: float) -> np.ndarray:
        """Return slacks ``(m,)`` moved to some distance from their bounds (section 3.6).

        Args:
            s: slacks.
            push: least distance, as a share of a bound's size (of 1, if smaller) and of the range between two bounds.
        """
        distance = np.where(self.has_low & self.has_high, push * (self.high - self.low), np.inf)
        least = self.low + np.minimum(push * np.maximum(1.0, np.abs(self.low)), distance)
        most = self.high - np.minimum(push * np.maximum(1.0, np.abs(self.high)), distance)
        s = np.where(self.has_low, np.maximum(s, least), s)
        return np.where(self.has_high, np.minimum(s, most), s)


@compiled
def logarithms(bounds: Bounds, s: np.ndarray) -> float:
    """Return the sum of the logarithms of all distances of slacks ``(m,)`` to bounds; NaN if one is not positive.

    Distances are multiplied as long as the product is in range, for a logarithm takes ten times as long.
    """
    total, product = 0.0, 1.0
    for i in range(len(s)):
        to_low = s[i] - bounds.low[i] if bounds.has_low[i] else 1.0
        to_high = bounds.high[i] - s[i] if bounds.has_high[i] else 1.0
        if not (to_low > 0.0 and to_high > 0.0):
            return np.nan
        product *= to_low
        if not _PRODUCT_LEAST < product < _PRODUCT_MOST:
            total += np.log(product)
            product = 1.0
        product *= to_high
        if not _PRODUCT_LEAST < product < _PRODUCT_MOST:
            total += np.log(product)
            product = 1.0
    return float(total + np.log(product))


@compiled
def derivatives(
    bounds: Bounds,
    s: np.ndarray,
    z_low: np.ndarray,
    z_high: np.ndarray,
    mu: float,
    weight: np.ndarray,
    slope: np.ndarray,
) -> None:
    """Write the barrier's primal-dual Hessian Σ, which is diagonal, and its gradient by the slacks.

    Args:
        bounds: of the slacks.
        s: slacks ``(m,)``.
        z_low: multipliers of the lower bounds ``(m,)``.
        z_high: multipliers of the upper bounds ``(m,)``.
        mu: of the barrier.
        weight: written, diagonal of Σ ``(m,)``.
        slope: written, gradient ``(m,)``.
    """
    for i in range(len(s)):
        weight[i] = slope[i] = 0.0
        if bounds.has_low[i]:
            distance = s[i] - bounds.low[i]
            weight[i] += z_low[i] / distance
            slope[i] -= mu / distance
        if bounds.has_high[i]:
            distance = bounds.high[i] - s[i]
            weight[i] += z_high[i] / distance
            slope[i] += mu / distance


@compiled
def complementarity(bounds: Bounds, s: np.ndarray, z_low: np.ndarray, z_high: np.ndarray) -> tuple[float, float]:
    """Return the least and the largest product of a slack's distance to a bound and the bound's multiplier."""
    least, largest = np.inf, -np.inf
    for i in range(len(s)):
        if bounds.has_low[i]:
            product = z_low[i] * (s[i] - bounds.low[i])
            least, largest = min(least, product), max(largest, product)
        if bounds.has_high[i]:
            product = z_high[i] * (bounds.high[i] - s[i])
            least, largest = min(least, product), max(largest, product)
    return least, largest


@compiled
def step_length(bounds: Bounds, s: np.ndarray, ds: np.ndarray, keep: float) -> float:
    """Return the largest share, at most 1, of a step ds ``(m,)`` that uses up no more than ``keep`` of any distance (15a)."""
    share = 1.0
    for i in range(len(s)):
        if bounds.has_low[i] and ds[i] < 0.0:
            share = min(share, -keep * (s[i] - bounds.low[i]) / ds[i])
        elif bounds.has_high[i] and ds[i] > 0.0:
            share = min(share, keep * (bounds.high[i] - s[i]) / ds[i])
    return share


@compiled
def update_multipliers(
    bounds: Bounds,
    before: np.ndarray,
    after: np.ndarray,
    ds: np.ndarray,
    z_low: np.ndarray,
    z_high: np.ndarray,
    mu: float,
    keep: float,
) -> None:
    """Move the bounds' multipliers along their Newton step (14d, 15b), and keep them near μ over the distance (16).

    Args:
        bounds: of the slacks.
        before: slacks at which the step was computed ``(m,)``.
        after: slacks that were stepped to ``(m,)``.
        ds: full step of the slacks ``(m,)``.
        z_low: multipliers of the lower bounds ``(m,)``, changed.
        z_high: multipliers of the upper bounds ``(m,)``, changed.
        mu: of the barrier.
        keep: share of a multiplier that a step may use up.
    """
    share = 1.0
    for i in range(len(ds)):
        if bounds.has_low[i]:
            change = (mu - z_low[i] * ds[i]) / (before[i] - bounds.low[i]) - z_low[i]
            if change < 0.0:
                share = min(share, -keep * z_low[i] / change)
        if bounds.has_high[i]:
            change = (mu + z_high[i] * ds[i]) / (bounds.high[i] - before[i]) - z_high[i]
            if change < 0.0:
                share = min(share, -keep * z_high[i] / change)
    for i in range(len(ds)):
        if bounds.has_low[i]:
            change = (mu - z_low[i] * ds[i]) / (before[i] - bounds.low[i]) - z_low[i]
            central = mu / (after[i] - bounds.low[i])
            z_low[i] = min(max(z_low[i] + share * change, central / _DUAL_RANGE), central * _DUAL_RANGE)
        if bounds.has_high[i]:
            change = (mu + z_high[i] * ds[i]) / (bounds.high[i] - before[i]) - z_high[i]
            central = mu / (bounds.high[i] - after[i])
            z_high[i] = min(max(z_high[i] + share * change, central / _DUAL_RANGE), central * _DUAL_RANGE)


@compiled
def residuals(
    lagrangian: np.ndarray, nu: np.ndarray, z_low: np.ndarray, z_high: np.ndarray, c: np.ndarray, gap: np.ndarray
) -> tuple[float, float]:
    """Return the largest entry of the Lagrangian's gradient, and that of the constraints' violation.

    Args:
        lagrangian: gradient by the variables ``(n_w,)``.
        nu: multipliers of d − s = 0 ``(m,)``; with z_low and z_high they make the gradient by the slacks.
        z_low: multipliers of the lower bounds ``(m,)``.
        z_high: multipliers of the upper bounds ``(m,)``.
        c: by how much equalities are missed.
        gap: by how much d − s = 0 is missed ``(m,)``.
    """
    slope = violation = 0.0
    for i in range(len(lagrangian)):
        slope = _larger(slope, lagrangian[i])
    for i in range(len(nu)):
        slope = _larger(slope, nu[i] + z_low[i] - z_high[i])
        violation = _larger(violation, gap[i])
    for i in range(len(c)):
        violation = _larger(violation, c[i])
    return slope, violation


@compiled
def norm_1(a: np.ndarray) -> float:
    """Return the sum of the absolute values of all entries."""
    size = 0.0
    for i in range(len(a)):
        size += abs(a[i])
    return size


@compiled
def _larger(size: float, a: float) -> float:
    """Return the larger of a size and the absolute value of ``a``; NaN if one of them is."""
    return size if abs(a) <= size or np.isnan(size) else abs(a)
