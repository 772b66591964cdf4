"""Is the estimate as good as it claims? Its errors against ground truth, phase by phase, over many runs.

An error is divided by the variance the estimator claims for it: the mean over runs of e² / P, per axis, is 1 for an
estimator that knows how good it is (normalized estimation error squared), above for one that is too sure of itself. The
attitude has no variance of its own: the estimator takes the inertial unit's word.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_LINEAR, BASE_ORIENTATION, BASE_POSITION
from aerial_model.values.estimate import Estimate
from aerial_wbic.behaviours.phase import Phase

SAMPLES = 25  # of each phase of a run: errors change slowly
CONFIDENCE = 0.95  # of the interval in which the mean over runs of a consistent estimator's figure lies
AXES = 3
PHASES = ("stance", "take_off", "flight", "landing")  # landing: until the end of its observation
ERRORS = ("position_m", "velocity_m_s", "attitude_deg")
NORMALIZED = ("position_nees", "velocity_nees")  # 1: as good as it claims


@dataclass(frozen=True, kw_only=True, eq=False)
class Belief:
    """What the controller believed at one tick, and what was true."""

    phase: Phase  # of the controller
    estimate: Estimate  # in the frame that began where the estimator did
    q: np.ndarray  # (nq,) the truth, in W
    v: np.ndarray  # (nv,)

    def figures(self, origin: np.ndarray) -> dict[str, float]:
        """Return the errors of ``ERRORS`` and, per axis, of ``NORMALIZED``.

        Args:
            origin: of the estimator's frame ``(3,)``, whose axes are those of W [m].
        """
        estimate = self.estimate
        position = estimate.q[BASE_POSITION] - (self.q[BASE_POSITION] - origin)
        believed, true = estimate.q[BASE_ORIENTATION], self.q[BASE_ORIENTATION]
        velocity = rotation.matrix(believed) @ estimate.v[BASE_LINEAR] - rotation.matrix(true) @ self.v[BASE_LINEAR]
        attitude = rotation.log(rotation.multiply(rotation.conjugate(true), believed))
        return {
            "position_m": float(np.linalg.norm(position)),
            "velocity_m_s": float(np.linalg.norm(velocity)),
            "attitude_deg": float(np.rad2deg(np.linalg.norm(attitude))),
            "position_nees": float(position @ position) / (AXES * estimate.position_variance),
            "velocity_nees": float(velocity @ velocity) / (AXES * estimate.velocity_variance),
        }


def sampled(beliefs: Sequence[Belief], origin: np.ndarray) -> dict[str, dict[str, list[float]]]:
    """Return samples of every figure in every phase of a run, evenly spaced: phase → figure → values.

    Args:
        beliefs: of all ticks.
        origin: of the estimator's frame ``(3,)``, in W [m].
    """
    of_phase: dict[str, list[Belief]] = {name: [] for name in PHASES}
    flown = False
    for belief in beliefs:
        flown = flown or belief.phase is Phase.FLIGHT
        of_phase[_name(belief.phase, flown)].append(belief)
    result = {}
    for name, members in of_phase.items():
        if members:
            chosen = np.linspace(0, len(members) - 1, min(SAMPLES, len(members))).astype(int)
            figures = [members[k].figures(origin) for k in chosen]
            result[name] = {figure: [each[figure] for each in figures] for figure in (*ERRORS, *NORMALIZED)}
    return result


def _name(phase: Phase, flown: bool) -> str:
    if phase in (Phase.TAKE_OFF, Phase.FLIGHT):
        return phase.name.lower()
    return "landing" if flown else "stance"


def summary(runs: Sequence[Mapping[str, Mapping[str, Sequence[float]]]]) -> dict[str, dict[str, Any]]:
    """Return the figures of every phase over the samples of many runs.

    Errors have their root mean square and the bound that 95 % of the samples keep; normalized ones their mean, with the
    interval in which it lies for a consistent estimator whose errors within a phase of a run are one and the same.
    """
    figures = {}
    for phase in PHASES:
        there = [run[phase] for run in runs if phase in run]
        if there:
            pooled = {name: np.concatenate([run[name] for run in there]) for name in (*ERRORS, *NORMALIZED)}
            freedoms = AXES * len(there)
            figures[phase] = {
                **{name: {"rms": _rms(pooled[name]), "p95": float(np.percentile(pooled[name], 95))} for name in ERRORS},
                **{name: float(pooled[name].mean()) for name in NORMALIZED},
                "nees_interval95": (chi2.interval(CONFIDENCE, freedoms) / np.float64(freedoms)).tolist(),
            }
    return figures


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
