"""Plans that are handed out, flown by MuJoCo as an independent integrator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerial_evaluation.bench.samples import Row, Sample
from aerial_evaluation.judgement.verification import verify
from aerial_model.robot.robot import Robot


def flown(robot: Robot, samples: Sequence[Sample]) -> Row:
    """Return how many accepted plans end at their goal, ``verified``, and the worst of them."""
    found = [verify(robot, sample.result.plan) for sample in samples if sample.accepted]
    return {
        "verified": sum(one.passed for one in found),
        "worst_attitude_error_deg": max((float(np.rad2deg(one.attitude_error)) for one in found), default=None),
        "worst_position_error_m": max((one.position_error for one in found), default=None),
    }
