"""Is the estimate as good as it claims? Its errors against ground truth, phase by phase, over many runs.

An error is divided by the variance the estimator claims for it: the mean over runs of e² / P, per axis, is 1 for an
estimator that knows how good it is (normalized estimation error squared), above for one that is too sure of itself. The
attitude has no variance of its own: the estimator takes the inertial unit's word.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from aerial_evaluation.record import IncompleteRunError, Run
from aerial_evaluation.statistics import CONFIDENCE, Distribution, PhaseSamples, pooled
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_LINEAR, BASE_ORIENTATION, BASE_POSITION
from aerial_model.values.estimate import Estimate
from aerial_model.values.frame import StartFrame
from aerial_sim.ground_truth import GroundTruth
from aerial_wbic.behaviours.phase import Phase

SAMPLES = 25  # of each phase of a run: errors change slowly
AXES = 3
PHASES = ("stance", "take_off", "flight", "landing")  # landing: until the end of its observation
ERRORS = ("position_m", "velocity_m_s", "attitude_deg")
NORMALIZED = ("position_nees", "velocity_nees")  # 1: as good as it claims


@dataclass(frozen=True, kw_only=True)
class EstimateErrors:
    """The errors of the estimate in one phase, over the samples of many runs."""

    errors: dict[str, Distribution]  # of ``ERRORS``
    normalized: dict[str, float]  # means of ``NORMALIZED``
    interval: tuple[float, float]  # in which a normalized error lies for a consistent estimator

    def to_json(self) -> dict[str, dict[str, float] | float | list[float]]:
        """Return root mean square and 95th percentile of the errors, the normalized ones, and their interval."""
        return {
            **{name: distribution.figures("rms", "p95") for name, distribution in self.errors.items()},
            **self.normalized,
            "nees_interval95": list(self.interval),
        }


def errors(estimate: Estimate, truth: GroundTruth, origin: np.ndarray) -> dict[str, float]:
    """Return the errors of ``ERRORS`` and, per axis, of ``NORMALIZED``.

    Args:
        estimate: of a state, in the frame that began where the estimator did.
        truth: the state, in W.
        origin: of the estimator's frame ``(3,)``, whose axes are those of W [m].
    """
    position = estimate.q[BASE_POSITION] - (truth.q[BASE_POSITION] - origin)
    q_est, q_true = estimate.q[BASE_ORIENTATION], truth.q[BASE_ORIENTATION]
    velocity = rotation.matrix(q_est) @ estimate.v[BASE_LINEAR] - rotation.matrix(q_true) @ truth.v[BASE_LINEAR]
    attitude = rotation.log(rotation.multiply(rotation.conjugate(q_true), q_est))
    return {
        "position_m": float(np.linalg.norm(position)),
        "velocity_m_s": float(np.linalg.norm(velocity)),
        "attitude_deg": float(np.rad2deg(np.linalg.norm(attitude))),
        "position_nees": float(position @ position) / (AXES * estimate.position_variance),
        "velocity_nees": float(velocity @ velocity) / (AXES * estimate.velocity_variance),
    }


def sampled(run: Run) -> PhaseSamples:
    """Return samples of every figure in every phase of a run, evenly spaced: phase → figure → values.

    The estimator's frame begins where the robot stood before the run's first tick.

    Raises:
        IncompleteRunError: if the run has no estimates, or does not say where it began.
    """
    if run.initial is None:
        raise IncompleteRunError("the run does not say where the robot was when the estimator began")
    origin = StartFrame.of(run.robot, run.initial.q).origin
    of_phase: dict[str, list[tuple[Estimate, GroundTruth]]] = {name: [] for name in PHASES}
    flown, truth = False, run.initial
    for tick in run.ticks:
        if tick.estimate is None or tick.phase is None:
            raise IncompleteRunError(f"the run has no estimate of the state at {truth.time:.3f} s")
        flown = flown or tick.phase is Phase.FLIGHT
        of_phase[_name(tick.phase, flown)].append((tick.estimate, truth))
        truth = tick.truth  # at the begin of the next period
    result = {}
    for name, members in of_phase.items():
        if members:
            chosen = np.linspace(0, len(members) - 1, min(SAMPLES, len(members))).astype(int)
            found = [errors(estimate, state, origin) for estimate, state in (members[int(k)] for k in chosen)]
            result[name] = {figure: [each[figure] for each in found] for figure in (*ERRORS, *NORMALIZED)}
    return result


def _name(phase: Phase, flown: bool) -> str:
    if phase in (Phase.TAKE_OFF, Phase.FLIGHT):
        return phase.name.lower()
    return "landing" if flown else "stance"


def summary(runs: Sequence[PhaseSamples]) -> dict[str, EstimateErrors]:
    """Return the figures of every phase over the samples of many runs.

    The interval of the normalized errors supposes that those within a phase of a run are one and the same.
    """
    result = {}
    for phase in PHASES:
        found = {name: Distribution.of(pooled(runs, phase, name)) for name in ERRORS}
        figures = {name: distribution for name, distribution in found.items() if distribution is not None}
        if figures:
            freedoms = AXES * sum(phase in run for run in runs)
            low, high = chi2.interval(CONFIDENCE, freedoms)
            result[phase] = EstimateErrors(
                errors=figures,
                normalized={name: float(pooled(runs, phase, name).mean()) for name in NORMALIZED},
                interval=(float(low) / freedoms, float(high) / freedoms),
            )
    return result
