"""Planning requests, measured, and what many of them amount to."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

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
        return max(peaks) <= ACTUATOR_TOLERANCE


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


def percentiles(values: Iterable[float]) -> dict[str, float] | None:
    """Return median and 95th percentile, linearly interpolated; None of nothing."""
    values = list(values)
    if not values:
        return None
    return {"p50": float(np.percentile(values, 50)), "p95": float(np.percentile(values, 95))}


def summary(samples: Sequence[Sample]) -> Row:
    """Return what repeated requests amount to; times and iterations are those of solved ones."""
    solved = [sample for sample in samples if sample.solved]
    reports = [sample.report for sample in solved]
    return {
        "trials": len(samples),
        "solved": len(solved),
        "accepted": sum(sample.accepted for sample in samples),
        "total_time_s": percentiles(report.total_time_s for report in reports),
        "cpu_time_s": percentiles(sample.cpu_time for sample in solved),
        "srbm_time_s": percentiles(report.srbm_time_s for report in reports),
        "solve_time_s": percentiles(report.solve_time_s for report in reports),
        "iterations": percentiles(report.iterations for report in reports),
        "refused_time_s": percentiles(sample.report.total_time_s for sample in samples if not sample.solved),
        "peak_torque_ratio": max((report.peak_torque_ratio for report in reports), default=None),
        "peak_voltage_ratio": max((report.peak_voltage_ratio for report in reports), default=None),
        "peak_speed_ratio": max((report.peak_speed_ratio for report in reports), default=None),
        "refusals": _refusals(samples),
    }


def _refusals(samples: Sequence[Sample]) -> list[Row]:
    """Return each reason, with how often it was given, most frequent first."""
    reasons = Counter(sample.report.refusal["reason"] for sample in samples if sample.report.refusal is not None)
    return [{"reason": reason, "times": times} for reason, times in reasons.most_common()]
