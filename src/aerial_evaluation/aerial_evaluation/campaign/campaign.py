"""Many seeded trials of one motion in closed loop.

A trial is determined by its seed and its world: any of them can be run again alone, and does the same.
"""

from __future__ import annotations

import pickle
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any

from aerial_evaluation.closed_loop import run
from aerial_evaluation.judgement import consistency, tracking
from aerial_evaluation.judgement.landing import Landing, judge
from aerial_evaluation.statistics import PhaseSamples
from aerial_model.errors import AerialError, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.codegen.library import default_cache
from aerial_planner.ocp.options import SolverName
from aerial_planner.planner import Planner
from aerial_sim.conditions import Conditions

FIGURES = ("tilt_deg", "position_error_m", "rotation_error_deg", "peak_torque_ratio", "peak_voltage_ratio")


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One run that is to be made."""

    seed: int
    conditions: Conditions


@dataclass(frozen=True, kw_only=True)
class Executed:
    """Verdict and figures of a trial whose motion was executed; the record of the run is not kept."""

    landing: Landing
    estimate: PhaseSamples = field(repr=False)  # errors of the estimate, see ``consistency``
    tracking: PhaseSamples = field(repr=False)  # distances from the plan, see ``tracking``
    plan_time: float | None  # from request to checked plan [s]
    real_time_factor: float | None

    @property
    def figures(self) -> dict[str, float]:
        """The figures of ``FIGURES``."""
        landing = self.landing.to_json()
        return {name: landing[name] for name in FIGURES}


@dataclass(frozen=True, kw_only=True)
class TrialResult:
    """What came of a trial."""

    trial: Trial
    reason: str = ""  # why it did not land
    executed: Executed | None = None  # None: refused, or its worker died

    @property
    def landed(self) -> bool:
        """Whether it was executed and landed."""
        return self.executed is not None and self.executed.landing.landed

    def to_json(self) -> dict[str, Any]:
        """Return the line of the results file."""
        result = {
            "seed": self.trial.seed,
            "conditions": asdict(self.trial.conditions),
            "landed": self.landed,
            "reason": self.reason,
        }
        if self.executed is None:
            return result
        return {
            **result,
            **self.executed.figures,
            "estimate": self.executed.estimate,
            "tracking": self.executed.tracking,
            "plan_time_s": self.executed.plan_time,
            "real_time_factor": self.executed.real_time_factor,
        }


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """What all trials have in common."""

    robot: Robot
    request: MotionRequest
    noise: str = "nominal"
    solver: str = SolverName.RICCATI

    def attempt(self, trial: Trial) -> TrialResult:
        """Return what came of a trial; a refusal is a result too."""
        try:
            record = run(
                self.robot,
                self.request,
                seed=trial.seed,
                noise=self.noise,
                conditions=trial.conditions,
                planner=_planner(pickle.dumps(self.robot), self.solver),
            )
        except RefusalError as refusal:
            return TrialResult(trial=trial, reason=f"refused: {refusal.reason}")
        except AerialError as error:
            return TrialResult(trial=trial, reason=str(error))
        landing = judge(record)
        executed = Executed(
            landing=landing,
            estimate=consistency.sampled(record),
            tracking=tracking.sampled(record),
            plan_time=None if record.report is None else record.report.total_time_s,
            real_time_factor=None if record.timing is None else record.timing.real_time_factor,
        )
        return TrialResult(trial=trial, reason=", ".join(landing.failed), executed=executed)


@lru_cache(maxsize=1)
def _planner(robot: bytes, solver: str) -> Planner:
    """Return this worker's planner, kept warm from trial to trial."""
    return Planner(pickle.loads(robot), solver=solver, cache=default_cache())
