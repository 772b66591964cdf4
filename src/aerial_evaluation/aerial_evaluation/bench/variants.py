"""The thesis's table 4.1: how long each variant takes for each motion, with and without the warm start."""

from __future__ import annotations

from aerial_evaluation.bench.samples import Row, Sample, measure, summary
from aerial_evaluation.bench.subject import Subject, usual_request
from aerial_planner.formulation.limits import Variant


def variants(subject: Subject) -> list[Row]:
    """Return one row per motion, variant and start.

    The variants take turns, so that whatever else the machine does meanwhile slows all alike. One plan of each, not
    counted, warms caches up.
    """
    rows = []
    for motion in subject.motions:
        requests = [
            usual_request(motion, subject.robot, variant, warm_start=warm)
            for variant in Variant
            for warm in (False, True)
        ]
        subject.progress(f"variants of {motion}: building")
        for request in requests:
            subject.planner.warm_up(request)
            measure(subject.planner, request)
        samples: list[list[Sample]] = [[] for _ in requests]
        for repeat in range(subject.repeats):
            subject.progress(f"variants of {motion}: {repeat + 1} of {subject.repeats}")
            for request, measured in zip(requests, samples, strict=True):
                measured.append(measure(subject.planner, request))
        rows += [
            {
                "motion": motion,
                "variant": request.variant,
                "warm_start": request.warm_start,
                **summary(measured).to_json(),
            }
            for request, measured in zip(requests, samples, strict=True)
        ]
    return rows
