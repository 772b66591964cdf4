"""What many samples amount to: the one place where percentiles and means are taken."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest

CONFIDENCE = 0.95  # of intervals around a share

MICRO = 1e6  # microseconds in a second

PhaseSamples = Mapping[str, Mapping[str, Sequence[float]]]  # phase of a motion → figure → its samples


@dataclass(frozen=True, kw_only=True)
class Distribution:
    """Percentiles (linearly interpolated), maximum and root mean square of samples."""

    p50: float
    p95: float
    p99: float
    max: float
    rms: float

    @staticmethod
    def of(values: Iterable[float]) -> Distribution | None:
        """Return the distribution of samples; None of nothing."""
        samples = np.array(list(values), dtype=float)
        if samples.size == 0:
            return None
        p50, p95, p99 = np.percentile(samples, (50, 95, 99)).tolist()
        rms = float(np.sqrt(np.mean(samples**2)))
        return Distribution(p50=p50, p95=p95, p99=p99, max=float(samples.max()), rms=rms)

    def figures(self, *names: str, scale: float = 1.0) -> dict[str, float]:
        """Return some of the figures by name, times ``scale``."""
        return {name: scale * getattr(self, name) for name in names}


@dataclass(frozen=True, kw_only=True)
class Share:
    """How many of some trials succeeded, with Wilson's interval of the share."""

    trials: int
    succeeded: int

    @property
    def rate(self) -> float | None:
        """The share; None of nothing."""
        return self.succeeded / self.trials if self.trials else None

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's interval of the share at ``CONFIDENCE``."""
        if not self.trials:
            return 0.0, 1.0
        interval = binomtest(self.succeeded, self.trials).proportion_ci(CONFIDENCE, method="wilson")
        return float(interval.low), float(interval.high)


def pooled(runs: Iterable[PhaseSamples], phase: str, name: str) -> np.ndarray:
    """Return the samples ``(k,)`` of one figure in one phase, over all runs that have that phase."""
    return np.concatenate([np.zeros(0), *(np.asarray(run[phase][name], dtype=float) for run in runs if phase in run)])
