"""Plans that are handed out, flown by MuJoCo as an independent integrator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerial_evaluation.bench.samples import Sample
from aerial_evaluation.judgement.verification import verify
from aerial_model.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class Flown:
    """How accepted plans end when MuJoCo flies them."""

    verified: int  # that end at their goal
    worst_attitude_error_deg: float | None
    worst_position_error_m: float | None


def flown(robot: Robot, samples: Sequence[Sample]) -> Flown:
    """Return how many accepted plans end at their goal, and the worst of them."""
    plans = [sample.result.plan for sample in samples if sample.result is not None and sample.accepted]
    found = [verify(robot, plan) for plan in plans]
    return Flown(
        verified=sum(one.passed for one in found),
        worst_attitude_error_deg=max((float(np.rad2deg(one.attitude_error)) for one in found), default=None),
        worst_position_error_m=max((one.position_error for one in found), default=None),
    )
