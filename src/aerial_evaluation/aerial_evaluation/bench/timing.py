"""What optimized phase durations gain, and what they cost."""

from __future__ import annotations

import dataclasses

import numpy as np

from aerial_evaluation.bench.goals import Family, draw, families, find_reach
from aerial_evaluation.bench.samples import Row, Sample, measure, percentiles, summary
from aerial_evaluation.bench.subject import Subject
from aerial_model.values.request import MotionRequest


def timing(subject: Subject) -> list[Row]:
    """Return one row per family of goals for fixed and one for optimized durations; they take turns at the same goals.

    Goals are drawn from the reach with fixed durations; costs and take-off times are those of goals that both solve.
    """
    rows = []
    for family in [family for motion in subject.motions for family in families(subject.robot, motion)]:
        both = {False: family, True: _timed(family)}
        subject.progress(f"timing of {family.name}: looking for the reach")
        reaches = {}
        for timed, asked in both.items():
            subject.planner.warm_up(asked.request(np.zeros(len(family.axes))))
            reaches[timed] = find_reach(asked, subject.planner)
        samples: dict[bool, list[Sample]] = {False: [], True: []}
        for k, goal in enumerate(draw(reaches[False], subject.goals, subject.seed)):
            if k % 10 == 0:
                subject.progress(f"timing of {family.name}: {k + 1} of {subject.goals}")
            for timed, measured in samples.items():
                measured.append(measure(subject.planner, both[timed].request(goal)))
        compared = [all(pair) for pair in zip(*([s.solved for s in m] for m in samples.values()), strict=True)]
        rows += [_row(family, timed, reaches[timed], samples[timed], compared) for timed in both]
    return rows


def _timed(family: Family) -> Family:
    def request(goal: np.ndarray) -> MotionRequest:
        return dataclasses.replace(family.request(goal), optimize_timing=True)

    return dataclasses.replace(family, request=request)


def _row(family: Family, timed: bool, reach: np.ndarray, samples: list[Sample], compared: list[bool]) -> Row:
    reports = [sample.report for sample, both in zip(samples, compared, strict=True) if both]
    return {
        "family": family.name,
        "optimize_timing": timed,
        "reach": dict(zip(family.axes, reach.T.tolist(), strict=True)),
        **summary(samples).to_json(),
        "compared": len(reports),
        "cost": percentiles(report.cost for report in reports),
        "take_off_time_s": percentiles(report.take_off_time_s for report in reports),
        "torque_ratio": percentiles(report.peak_torque_ratio for report in reports),
        "voltage_ratio": percentiles(report.peak_voltage_ratio for report in reports),
    }
