"""Goals inside a motion's reach: how often they are planned, how fast, and what they ask of the actuators.

A motion's goals are measured from its usual landing place along a few axes: ahead, to the left, turns about the
vertical, the height of a platform. The reach along each, to either side, is found by bisection with the planner's own
verdict; goals are then spread evenly over the part of the ellipsoid through these ends that ``SHARE`` of it spans. What is
handed out is flown by MuJoCo.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
from scipy.stats import qmc

from aerial_evaluation.bench.flown import flown
from aerial_evaluation.bench.samples import Row, Sample, measure, summary
from aerial_evaluation.bench.subject import Subject
from aerial_evaluation.bench.violations import violations_to_json
from aerial_model.robot.robot import Robot
from aerial_model.values.request import LOWER_MARGIN, UPPER_MARGIN, MotionRequest
from aerial_planner.formulation.limits import Variant
from aerial_planner.motion.motion import load_motion
from aerial_planner.planner import Planner

SHARE = 0.8  # of the reach along each axis within which goals are drawn
_HALVINGS = 5  # of the search for a reach
_DISTANCE_BOUND = 8.0  # no robot here lands farther from its usual place than so many of its heights
_HEIGHT_BOUND = 3.0  # or so much higher or lower
_TURNS_BOUND = 1.5  # or turns about the vertical by more
_PLATFORM_ROOM = 1.5  # of a jump onto a platform: its distance over the least at which the feet fit
_SPREAD = 4  # points drawn in a cube for one in the ball, at least
_SIDES = {"forward": (1.0, 0.0, 0.0), "left": (0.0, 1.0, 0.0)}  # to which jumps onto platforms are tried
_VERTICAL = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class Family:
    """Goals of one motion that differ in a few numbers."""

    name: str
    axes: tuple[str, ...]
    bound: np.ndarray  # (d,) beyond which no reach is looked for
    request: Callable[[np.ndarray], MotionRequest]  # from the numbers (d,)


def goals(subject: Subject) -> list[Row]:
    """Return one row per family of goals and variant, then one per variant over all of them."""
    rows = []
    everything: dict[Variant, list[Sample]] = {variant: [] for variant in Variant}
    for family in [family for motion in subject.motions for family in families(subject.robot, motion)]:
        subject.progress(f"goals of {family.name}: looking for the reach")
        subject.planner.warm_up(family.request(np.zeros(len(family.axes))))
        reach = find_reach(family, subject.planner)
        drawn = draw(reach, subject.goals, subject.seed)
        measured = _measured(subject, family, drawn)
        for variant, samples in measured.items():
            everything[variant] += samples
            rows.append(
                {
                    "family": family.name,
                    "reach": dict(zip(family.axes, reach.T.tolist(), strict=True)),
                    "variant": variant.value,
                    **summary(samples).to_json(),
                    **violations_to_json(samples),
                    **asdict(flown(subject.robot, samples)),
                }
            )
    for variant, samples in everything.items():
        row = {"family": "all", "reach": None, "variant": variant.value}
        rows.append(
            {
                **row,
                **summary(samples).to_json(),
                **violations_to_json(samples),
                **asdict(flown(subject.robot, samples)),
            }
        )
    return rows


def _measured(subject: Subject, family: Family, drawn: np.ndarray) -> dict[Variant, list[Sample]]:
    """Return the goals' samples; the variants take turns, each with the single-rigid-body warm start."""
    measured: dict[Variant, list[Sample]] = {variant: [] for variant in Variant}
    for variant in Variant:
        subject.planner.warm_up(_as(variant, family.request(drawn[0])))
    for k, goal in enumerate(drawn):
        if k % 10 == 0:
            subject.progress(f"goals of {family.name}: {k + 1} of {len(drawn)}")
        for variant, samples in measured.items():
            samples.append(measure(subject.planner, _as(variant, family.request(goal))))
    return measured


def _as(variant: Variant, request: MotionRequest) -> MotionRequest:
    return dataclasses.replace(request, variant=variant.value)


def find_reach(family: Family, planner: Planner) -> np.ndarray:
    """Return how far along each axis, backward and forward, goals are planned ``(2, d)``: (≤ 0, ≥ 0).

    Bisection assumes that what lies nearer than a goal is planned if the goal is.
    """
    d = len(family.axes)
    reach = np.zeros((2, d))
    for axis in range(d):
        for row, sense in ((0, -1.0), (1, 1.0)):
            direction = sense * family.bound[axis] * np.eye(d)[axis]
            low, high = 0.0, 1.0
            for _ in range(_HALVINGS):
                middle = (low + high) / 2
                planned = measure(planner, family.request(middle * direction)).accepted
                low, high = (middle, high) if planned else (low, middle)
            reach[row, axis] = low * direction[axis]
    return reach


def draw(reach: np.ndarray, n: int, seed: int) -> np.ndarray:
    """Return ``n`` goals ``(n, d)`` within ``SHARE`` of a reach ``(2, d)``, evenly spread; the same for the same seed."""
    d = reach.shape[1]
    cube = 2 * qmc.Halton(d, rng=seed).random(_SPREAD * n) - 1
    ball = cube[np.linalg.norm(cube, axis=1) <= 1][:n]
    return SHARE * ball * np.where(ball < 0, -reach[0], reach[1])


def families(robot: Robot, motion: str) -> list[Family]:
    """Return the families of goals of a motion that its file allows to set."""
    said = load_motion(motion, robot)
    if "displacement" not in said.goal:
        return []
    size = robot.standing_configuration()[2]  # height of the base [m]
    plane, bound = ("x", "y"), _DISTANCE_BOUND * size * np.ones(2)
    if said.rotation is None:
        heights = [_heights(robot, motion, side, _HEIGHT_BOUND * size) for side in _SIDES]
        return [Family(name=motion, axes=plane, bound=bound, request=_level(motion, said.displacement)), *heights]
    if "rotation" not in said.goal:
        return [Family(name=motion, axes=plane, bound=bound, request=_level(motion, said.displacement))]
    if np.allclose(said.rotation.axis, _VERTICAL):
        bound = np.append(bound, _TURNS_BOUND)
        return [Family(name=motion, axes=("x", "y", "turns"), bound=bound, request=_level(motion, said.displacement))]
    turns = said.rotation.turns
    return [
        Family(name=motion, axes=plane, bound=bound, request=_level(motion, said.displacement, turns)),
        Family(
            name=f"{motion} reversed",
            axes=plane,
            bound=bound,
            request=_level(motion, said.usual_displacement(-turns), -turns),
        ),
    ]


def _level(motion: str, usual: np.ndarray, turns: float | None = None) -> Callable[[np.ndarray], MotionRequest]:
    """Return the request for a landing so far from the ``usual`` displacement ``(3,)``; a third number is the turns."""

    def request(goal: np.ndarray) -> MotionRequest:
        displacement = usual + [goal[0], goal[1], 0.0]
        asked = float(goal[2]) if len(goal) > 2 else turns
        return MotionRequest(motion=motion, displacement=displacement, rotation=asked)

    return request


def _heights(robot: Robot, motion: str, side: str, bound: float) -> Family:
    """Return jumps onto or off a platform, so far to that side that the feet fit on either side of its edge."""
    direction = np.array(_SIDES[side])
    standing, landing = (
        robot.contact_positions(robot.standing_configuration(pose)) @ direction for pose in ("home", "landing")
    )
    distance = _PLATFORM_ROOM * (standing.max() - landing.min() + UPPER_MARGIN + LOWER_MARGIN)

    def request(goal: np.ndarray) -> MotionRequest:
        level = MotionRequest(motion=motion, displacement=distance * direction + goal[0] * _VERTICAL)
        return level.with_platform(robot) if goal[0] != 0 else level

    return Family(name=f"{motion} {side} onto or off", axes=("z",), bound=np.array([bound]), request=request)
