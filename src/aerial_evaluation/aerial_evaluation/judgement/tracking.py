"""How closely a robot follows its plan: the truth against the plan in take-off and flight, against rest after landing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from aerial_evaluation.judgement.landing import Tick
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, Robot
from aerial_model.values.frame import StartFrame
from aerial_model.values.plan import Plan

SAMPLES = 25  # of each phase of a run
PHASES = ("take_off", "flight", "landing")  # landing: its first ``CATCH_TIME``
CATCH_TIME = 0.5  # in which a landing is caught or lost [s]
FIGURES = ("com_m", "attitude_deg", "angular_momentum")  # the last in kg·m²/s, about the centre of mass


def sampled(
    robot: Robot, plan: Plan, *, frame: StartFrame, start_time: float, ticks: Sequence[Tick]
) -> dict[str, dict[str, list[float]]]:
    """Return samples of every figure in every phase of a run, evenly spaced: phase → figure → values.

    After landing the centre of mass is compared with the centre of the support, level, the attitude with upright, the
    angular momentum with none.

    Args:
        robot: that ran it.
        plan: in the start heading frame.
        frame: the true start heading frame.
        start_time: when the plan began [s].
        ticks: of the run.
    """
    placed, data = plan.placed(frame), robot.model.createData()
    time = np.array([tick.truth.time for tick in ticks]) - start_time
    ends = np.array([0.0, plan.take_off_time, plan.landing_time, plan.landing_time + CATCH_TIME])
    result = {}
    for name, begin, end in zip(PHASES, ends[:-1], ends[1:], strict=True):
        members = np.flatnonzero((begin <= time) & (time < end))
        if len(members) == 0:
            continue
        chosen = members[np.linspace(0, len(members) - 1, min(SAMPLES, len(members))).astype(int)]
        rows = []
        for k in chosen:
            truth = ticks[k].truth
            alpha = pin.computeCentroidalMomentum(robot.model, data, truth.q, truth.v).angular
            attitude, com = truth.q[BASE_ORIENTATION], data.com[0]
            if name == "landing":
                aside = com - robot.contact_positions(truth.q).mean(axis=0)
                rows.append((aside[:2], rotation.tilt(attitude), alpha))
            else:
                wanted = placed.sample(time[k])
                turn = rotation.log(rotation.multiply(rotation.conjugate(wanted.q[BASE_ORIENTATION]), attitude))
                rows.append((com - wanted.com, turn, alpha - wanted.angular_momentum))
        sizes = np.array([[np.linalg.norm(part) for part in row] for row in rows]) * [1.0, np.rad2deg(1.0), 1.0]
        result[name] = dict(zip(FIGURES, sizes.T.tolist(), strict=True))
    return result


def summary(runs: Sequence[Mapping[str, Mapping[str, Sequence[float]]]]) -> dict[str, dict[str, Any]]:
    """Return root mean square and 95th percentile of every figure in every phase, over the samples of many runs."""
    figures = {}
    for phase in PHASES:
        there = [run[phase] for run in runs if phase in run]
        if there:
            pooled = {name: np.concatenate([run[name] for run in there]) for name in FIGURES}
            figures[phase] = {
                name: {"rms": float(np.sqrt(np.mean(values**2))), "p95": float(np.percentile(values, 95))}
                for name, values in pooled.items()
            }
    return figures
