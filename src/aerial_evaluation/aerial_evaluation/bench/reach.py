"""How far a robot jumps in each direction, how high onto a platform, and what binds just beyond."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict

import numpy as np

from aerial_evaluation.bench import reach_figure
from aerial_evaluation.bench.reach_figure import End
from aerial_evaluation.bench.samples import Row, measure
from aerial_evaluation.bench.subject import Subject
from aerial_model.values.request import MotionRequest
from aerial_planner.planner import Planner

DIRECTIONS = 16  # of the map
PLATFORM_DISTANCES = (1.5, 2.0, 2.5, 3.0, 3.5)  # of the landing, in heights of the base
_MOTION = "jump"
_BOUND = 8.0  # no robot here jumps farther than so many heights of its base, …
_HEIGHT_BOUND = 3.0  # … or onto a platform so high
_STEPS = 8  # in which a reach is looked for outwards, …
_HALVINGS = 4  # … then halved: a single goal that is missed does not pass for the end


def reach(subject: Subject) -> list[Row]:
    """Return one row per direction on flat ground, then one per distance of a platform ahead; draw the map of both."""
    if _MOTION not in subject.motions:
        return []
    size = subject.robot.standing_configuration()[2]  # height of the base [m]
    subject.planner.warm_up(MotionRequest(motion=_MOTION))
    ends: list[End] = []
    for angle in 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
        subject.progress(f"reach: {np.rad2deg(angle):.0f}°")
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        distance, binds = farthest(subject.planner, _along(direction), _BOUND * size)
        ends.append(
            End(
                direction_deg=float(np.rad2deg(angle)),
                on_platform=False,
                distance_m=distance,
                height_m=0.0,
                binds=binds,
            )
        )
    for heights in PLATFORM_DISTANCES:
        distance = heights * size
        subject.progress(f"reach: a platform, {distance:.2f} m ahead")
        height, binds = farthest(subject.planner, _onto(subject, distance), _HEIGHT_BOUND * size)
        ends.append(End(direction_deg=0.0, on_platform=True, distance_m=distance, height_m=height, binds=binds))
    file = subject.folder / "reach.png"
    reach_figure.draw(ends, file)
    subject.progress(f"reach: the map is {file}")
    return [asdict(end) for end in ends]


def farthest(planner: Planner, request: Callable[[float], MotionRequest], bound: float) -> tuple[float, str]:
    """Return the largest number up to ``bound`` whose request is planned, and why the one beyond is refused."""
    step = bound / _STEPS
    reached, misses, binds = 0.0, 0, ""
    for number in step * np.arange(1, _STEPS + 1):
        refusal = _refusal(planner, request(number))
        if refusal is None:
            reached, misses = float(number), 0
        else:
            binds, misses = binds if misses else refusal, misses + 1
        if misses == 2:
            break
    for _ in range(_HALVINGS):
        step /= 2
        refusal = _refusal(planner, request(reached + step))
        reached, binds = (reached + step, binds) if refusal is None else (reached, refusal)
    return reached, binds


def _refusal(planner: Planner, request: MotionRequest) -> str | None:
    """Return why a request is refused, None if it is planned."""
    sample = measure(planner, request)
    if sample.accepted:
        return None
    refusal = sample.report.refusal
    return "exact torque, voltage or speed" if refusal is None else refusal["reason"]


def _along(direction: np.ndarray) -> Callable[[float], MotionRequest]:
    return lambda distance: MotionRequest(motion=_MOTION, displacement=distance * direction)


def _onto(subject: Subject, distance: float) -> Callable[[float], MotionRequest]:
    def request(height: float) -> MotionRequest:
        level = MotionRequest(motion=_MOTION, displacement=np.array([distance, 0.0, height]))
        return level.with_platform(subject.robot)

    return request
