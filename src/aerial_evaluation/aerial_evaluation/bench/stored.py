"""What a small library of plans gains over the single-rigid-body warm start, and over none."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import numpy as np

from aerial_evaluation.bench.goals import SHARE, Family, draw, families, find_reach
from aerial_evaluation.bench.samples import Row, Sample, measure, summary
from aerial_evaluation.bench.subject import Subject
from aerial_model.values.plan import Plan
from aerial_planner.assembly.library import PlanLibrary

STARTS = ("reference", "srbm", "library")


class _FixedLibrary(PlanLibrary):
    """Takes no plan any more: all goals meet the same library."""

    def add(self, plan: Plan) -> None:
        """Do nothing."""


def library(subject: Subject) -> list[Row]:
    """Return one row per family of goals and start; the starts take turns.

    The library holds the family's usual plan, and one half-way to each end of what goals are drawn from.
    """
    rows = []
    for family in [family for motion in subject.motions for family in families(subject.robot, motion)]:
        subject.progress(f"library of {family.name}: looking for the reach")
        subject.planner.warm_up(family.request(np.zeros(len(family.axes))))
        reach = find_reach(family, subject.planner)
        with tempfile.TemporaryDirectory() as folder:
            stored = _filled(subject, family, reach, Path(folder))
            subject.planner.plans = stored
            subject.planner.warm_up(family.request(np.zeros(len(family.axes))))
            samples = _measured(subject, family, draw(reach, subject.goals, subject.seed), stored)
        for start, measured in samples.items():
            found = sum(sample.report.started_from == "library" for sample in measured)
            rows.append(
                {
                    "family": family.name,
                    "start": start,
                    "stored": len(stored),
                    "found": found,
                    **summary(measured).to_json(),
                }
            )
    return rows


def _filled(subject: Subject, family: Family, reach: np.ndarray, folder: Path) -> PlanLibrary:
    d = len(family.axes)
    halfway = [SHARE / 2 * end[axis] * np.eye(d)[axis] for end in reach for axis in range(d)]
    plans = PlanLibrary(folder, subject.robot, subject.progress)
    for goal in [np.zeros(d), *halfway]:
        sample = measure(subject.planner, family.request(goal))
        if sample.result is not None:
            plans.add(sample.result.plan)
    return _FixedLibrary(folder, subject.robot, subject.progress)


def _measured(subject: Subject, family: Family, drawn: np.ndarray, stored: PlanLibrary) -> dict[str, list[Sample]]:
    samples: dict[str, list[Sample]] = {start: [] for start in STARTS}
    for k, goal in enumerate(drawn):
        if k % 10 == 0:
            subject.progress(f"library of {family.name}: {k + 1} of {len(drawn)}")
        for start, measured in samples.items():
            request = dataclasses.replace(family.request(goal), warm_start=start != "reference")
            subject.planner.plans = stored if start == "library" else None
            measured.append(measure(subject.planner, request))
    subject.planner.plans = None
    return samples
