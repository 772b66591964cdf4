"""Whether a planner that runs for long keeps its size."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from aerial_evaluation.bench.samples import Row, measure
from aerial_evaluation.bench.subject import Subject, usual_request
from aerial_model.values.request import MotionRequest
from aerial_planner.motion.motion import load_motion
from aerial_planner.planner import Planner

REQUESTS = 500
ROWS = 10
_DISTANCE = 1.2  # to either side [m]
_YAW = 1.5  # [rad]
_TURNS = (-1.0, -0.5, 0.5, 1.0)
_NONSENSE = 0.05  # share of requests for a motion that does not exist
_MEGABYTE = 1e6


def memory(subject: Subject) -> list[Row]:
    """Return what the process holds after each tenth of ``REQUESTS`` varied ones, about half of them refused.

    The planner has built what it needs before the first row: problems of all contact schedules there are.
    """
    planner = Planner(subject.robot, cache=subject.cache)
    for motion in subject.motions:
        subject.progress(f"memory: building {motion}")
        for request in (usual_request(motion, subject.robot), *_turning(subject, motion)):
            planner.warm_up(request)
            measure(planner, request)
    rows = [{"requests": 0, "planned": 0, "memory_mb": _resident()}]
    planned = 0
    for k, request in enumerate(_requests(subject), start=1):
        planned += measure(planner, request).solved
        if k % (REQUESTS // ROWS) == 0:
            subject.progress(f"memory: {k} of {REQUESTS}")
            rows.append({"requests": k, "planned": planned, "memory_mb": _resident()})
    return rows


def _turning(subject: Subject, motion: str) -> list[MotionRequest]:
    """Return a motion to its other sides, whose contact schedules may differ."""
    if "rotation" not in load_motion(motion, subject.robot).goal:
        return []
    return [MotionRequest(motion=motion, rotation=turns) for turns in _TURNS]


def _requests(subject: Subject) -> Iterator[MotionRequest]:
    random = np.random.default_rng(subject.seed)
    for _ in range(REQUESTS):
        motion = str(random.choice(subject.motions))
        said = load_motion(motion, subject.robot)
        yield MotionRequest(
            motion=f"no {motion}" if random.random() < _NONSENSE else motion,
            displacement=np.array([*random.uniform(-_DISTANCE, _DISTANCE, 2), 0.0]),
            yaw=random.uniform(-_YAW, _YAW) if "yaw" in said.goal else 0.0,
            rotation=float(random.choice(_TURNS)) if "rotation" in said.goal else None,
        )


def _resident() -> float:
    """Return what the process holds in memory now [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / _MEGABYTE
