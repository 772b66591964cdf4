"""How closely a robot follows its plan: the truth against the plan in take-off and flight, against rest after landing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from aerial_evaluation.record import Run
from aerial_evaluation.statistics import Distribution, PhaseSamples, pooled
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION

SAMPLES = 25  # of each phase of a run
PHASES = ("take_off", "flight", "landing")  # landing: its first ``CATCH_TIME``
CATCH_TIME = 0.5  # in which a landing is caught or lost [s]
FIGURES = ("com_m", "attitude_deg", "angular_momentum")  # the last in kg·m²/s, about the centre of mass


@dataclass(frozen=True, kw_only=True)
class TrackingErrors:
    """The distribution of every figure of ``FIGURES`` in one phase, over the samples of many runs."""

    figures: dict[str, Distribution]

    def to_json(self) -> dict[str, dict[str, float]]:
        """Return root mean square and 95th percentile of every figure."""
        return {name: distribution.figures("rms", "p95") for name, distribution in self.figures.items()}


def sampled(run: Run) -> PhaseSamples:
    """Return samples of every figure in every phase of a run, evenly spaced: phase → figure → values.

    After landing the centre of mass is compared with the centre of the support, level, the attitude with upright, the
    angular momentum with none.
    """
    plan, time = run.plan, run.time - run.start_time
    ends = np.array([0.0, plan.take_off_time, plan.landing_time, plan.landing_time + CATCH_TIME])
    result = {}
    for name, begin, end in zip(PHASES, ends[:-1], ends[1:], strict=True):
        members = np.flatnonzero((begin <= time) & (time < end))
        if len(members) > 0:
            chosen = members[np.linspace(0, len(members) - 1, min(SAMPLES, len(members))).astype(int)]
            result[name] = _errors(run, time, chosen, landed=name == "landing")
    return result


def _errors(run: Run, time: np.ndarray, chosen: np.ndarray, *, landed: bool) -> dict[str, list[float]]:
    """Return the sizes of the errors at the ``chosen`` ticks, figure by figure."""
    robot, placed, data = run.robot, run.plan.placed(run.start_frame), run.robot.model.createData()
    rows: list[tuple[np.ndarray, np.ndarray | float, np.ndarray]] = []
    for k in chosen:
        truth = run.ticks[k].truth
        alpha = pin.computeCentroidalMomentum(robot.model, data, truth.q, truth.v).angular
        attitude, com = truth.q[BASE_ORIENTATION], data.com[0]
        if landed:
            aside = com - robot.contact_positions(truth.q).mean(axis=0)
            rows.append((aside[:2], rotation.tilt(attitude), alpha))
        else:
            target = placed.sample(time[k])
            turn = rotation.log(rotation.multiply(rotation.conjugate(target.q[BASE_ORIENTATION]), attitude))
            rows.append((com - target.com, turn, alpha - target.angular_momentum))
    sizes = np.array([[np.linalg.norm(part) for part in row] for row in rows]) * [1.0, np.rad2deg(1.0), 1.0]
    return dict(zip(FIGURES, sizes.T.tolist(), strict=True))


def summary(runs: Sequence[PhaseSamples]) -> dict[str, TrackingErrors]:
    """Return the distribution of every figure in every phase, over the samples of many runs."""
    result = {}
    for phase in PHASES:
        found = {name: Distribution.of(pooled(runs, phase, name)) for name in FIGURES}
        figures = {name: distribution for name, distribution in found.items() if distribution is not None}
        if figures:
            result[phase] = TrackingErrors(figures=figures)
    return result
