"""Planning requests, measured, and what many of them amount to.

A section of a benchmark puts together the rows of a table, which are plain JSON types; all that goes into them is typed.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from aerial_evaluation.statistics import Distribution
from aerial_model.errors import RefusalError
from aerial_model.values.request import MotionRequest
from aerial_planner.assembly.checks import ACTUATOR_TOLERANCE
from aerial_planner.planner import Planner
from aerial_planner.report import PlanningResult, PlanReport

Row = dict[str, Any]  # one line of a table; plain JSON types


@dataclass(frozen=True, kw_only=True)
class Sample:
    """One request, planned by a planner that does not refuse what the actuators cannot do."""

    report: PlanReport
    cpu_time: float  # the process spent [s]: unlike wall time hardly longer on a busy machine
    result: PlanningResult | None  # None: refused

    @property
    def solved(self) -> bool:
        """The optimization converged, and every check passed but that of the actuators."""
        return self.result is not None

    @property
    def accepted(self) -> bool:
        """The exact torques, voltages and speeds are within tolerance too: a planner hands this plan out."""
        if self.result is None:
            return False
        report = self.report
        peaks = (report.peak_torque_ratio, report.peak_voltage_ratio, report.peak_speed_ratio)
        return max(peak for peak in peaks if peak is not None) <= ACTUATOR_TOLERANCE


def measure(planner: Planner, request: MotionRequest) -> Sample:
    """Plan once; a refusal is a sample too."""
    began = time.process_time()
    try:
        result = planner.plan(request)
        report = result.report
    except RefusalError as refusal:
        if refusal.report is None:
            raise
        result, report = None, refusal.report
    return Sample(report=report, cpu_time=time.process_time() - began, result=result)


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What repeated requests amount to; times and iterations are those of solved ones, None if none was."""

    trials: int
    solved: int
    accepted: int
    total_time: Distribution | None  # [s]
    cpu_time: Distribution | None  # [s]
    srbm_time: Distribution | None  # [s]
    solve_time: Distribution | None  # [s]
    iterations: Distribution | None
    refused_time: Distribution | None  # of the refused ones [s]
    peak_torque_ratio: float | None  # the greatest
    peak_voltage_ratio: float | None
    peak_speed_ratio: float | None
    refusals: tuple[tuple[str, int], ...]  # reason, how often it was given; the most frequent first

    def to_json(self) -> Row:
        """Return the figures as plain JSON types."""
        return {
            "trials": self.trials,
            "solved": self.solved,
            "accepted": self.accepted,
            "total_time_s": spread(self.total_time),
            "cpu_time_s": spread(self.cpu_time),
            "srbm_time_s": spread(self.srbm_time),
            "solve_time_s": spread(self.solve_time),
            "iterations": spread(self.iterations),
            "refused_time_s": spread(self.refused_time),
            "peak_torque_ratio": self.peak_torque_ratio,
            "peak_voltage_ratio": self.peak_voltage_ratio,
            "peak_speed_ratio": self.peak_speed_ratio,
            "refusals": [{"reason": reason, "times": times} for reason, times in self.refusals],
        }


def summary(samples: Sequence[Sample]) -> Summary:
    """Return what repeated requests amount to."""
    solved = [sample for sample in samples if sample.solved]
    reports = [sample.report for sample in solved]
    reasons = Counter(sample.report.refusal["reason"] for sample in samples if sample.report.refusal is not None)
    return Summary(
        trials=len(samples),
        solved=len(solved),
        accepted=sum(sample.accepted for sample in samples),
        total_time=Distribution.of(report.total_time_s for report in reports),
        cpu_time=Distribution.of(sample.cpu_time for sample in solved),
        srbm_time=Distribution.of(report.srbm_time_s for report in reports),
        solve_time=Distribution.of(report.solve_time_s for report in reports),
        iterations=Distribution.of(report.iterations for report in reports),
        refused_time=Distribution.of(sample.report.total_time_s for sample in samples if not sample.solved),
        peak_torque_ratio=_greatest(report.peak_torque_ratio for report in reports),
        peak_voltage_ratio=_greatest(report.peak_voltage_ratio for report in reports),
        peak_speed_ratio=_greatest(report.peak_speed_ratio for report in reports),
        refusals=tuple(reasons.most_common()),
    )


def spread(distribution: Distribution | None) -> dict[str, float] | None:
    """Return median and 95th percentile as plain JSON types; None of nothing."""
    return None if distribution is None else distribution.figures("p50", "p95")


def percentiles(values: Iterable[float | None]) -> dict[str, float] | None:
    """Return median and 95th percentile of the values there are as plain JSON types; None of nothing."""
    return spread(Distribution.of(value for value in values if value is not None))


def _greatest(values: Iterable[float | None]) -> float | None:
    return max((value for value in values if value is not None), default=None)
