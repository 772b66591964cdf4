"""One record of a run: what was planned, measured and commanded tick by tick, and what really happened.

The closed loop makes it, and so does a recording of running nodes; judge, tracking, consistency, pictures and benchmarks
read it. What a source cannot know is None, and who needs it says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from aerial_evaluation.statistics import MICRO, Distribution
from aerial_model.errors import AerialError
from aerial_model.robot.robot import Robot
from aerial_model.values.command import Command
from aerial_model.values.estimate import Estimate
from aerial_model.values.frame import StartFrame
from aerial_model.values.measurement import Measurement
from aerial_model.values.plan import Plan
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import Terrain
from aerial_planner.report import PlanReport
from aerial_sim.conditions import Conditions
from aerial_sim.ground_truth import GroundTruth
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.trace import TickTrace


class IncompleteRunError(AerialError):
    """A record of a run lacks what its reader needs."""


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Tick:
    """One control period: a measurement at its begin, the controller's answer, the true state at its end."""

    truth: GroundTruth  # at the end of the period
    measurement: Measurement | None = None  # at its begin
    command: Command | None = None  # that answers the measurement
    phase: Phase | None = None  # of the controller when it answered
    estimate: Estimate | None = None  # of the state at the begin, in the frame that began where the estimator did
    fallback: bool = False  # the force optimization failed and the fallback's forces were commanded
    trace: TickTrace | None = None  # what the controller saw and wanted in detail, where it was asked for


@dataclass(frozen=True, kw_only=True)
class TickTimes:
    """Wall time of the controller's steps."""

    p50: float  # median [s]
    p99: float  # 99th percentile [s]
    max: float  # [s]

    @staticmethod
    def of(times: Sequence[float]) -> TickTimes | None:
        """Return the distribution of times [s]; None of nothing."""
        all_times = Distribution.of(times)
        return None if all_times is None else TickTimes(p50=all_times.p50, p99=all_times.p99, max=all_times.max)

    def to_json(self) -> dict[str, float]:
        """Return the times in microseconds."""
        return {"p50": MICRO * self.p50, "p99": MICRO * self.p99, "max": MICRO * self.max}


@dataclass(frozen=True, kw_only=True)
class Timing:
    """How fast a run was computed."""

    tick: TickTimes | None
    real_time_factor: float  # simulated over wall time, simulator and controller together
    cpu_factor: float | None = None  # simulated over processor time: the real-time factor on an otherwise idle machine


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One motion as it was executed, with the time before and after it that was recorded."""

    robot: Robot
    plan: Plan  # in the start heading frame
    start_frame: StartFrame  # true, in W
    start_time: float  # of the plan's time 0, on the clock of the ticks [s]
    ticks: Sequence[Tick] = field(repr=False)  # one per control period, in order
    initial: GroundTruth | None = field(default=None, repr=False)  # at the begin of the first tick
    request: MotionRequest | None = None
    report: PlanReport | None = field(default=None, repr=False)  # the planner's figures
    terrain: Terrain | None = None  # in W
    conditions: Conditions = field(default_factory=Conditions)  # of the world
    seed: int | None = None
    noise: str | None = None
    timing: Timing | None = None

    @property
    def end_time(self) -> float:
        """Time of the last true state [s]; the start time of a run without ticks."""
        return self.ticks[-1].truth.time if self.ticks else self.start_time

    @property
    def time(self) -> np.ndarray:
        """Times ``(K,)`` of the true states [s]."""
        return np.array([tick.truth.time for tick in self.ticks])

    @property
    def q(self) -> np.ndarray:
        """True configurations ``(K, nq)``, in W."""
        return np.array([tick.truth.q for tick in self.ticks])

    @property
    def commands(self) -> list[Command]:
        """The command of every tick.

        Raises:
            IncompleteRunError: if one is missing.
        """
        commands = [tick.command for tick in self.ticks if tick.command is not None]
        self._require(len(commands), "a command")
        return commands

    @property
    def measurements(self) -> list[Measurement]:
        """The measurement of every tick.

        Raises:
            IncompleteRunError: if one is missing.
        """
        measurements = [tick.measurement for tick in self.ticks if tick.measurement is not None]
        self._require(len(measurements), "a measurement")
        return measurements

    @property
    def displacement(self) -> np.ndarray:
        """Way ``(3,)`` of the support centre from the start to the last true state, in the start heading frame [m]."""
        end = StartFrame.of(self.robot, self.ticks[-1].truth.q).origin
        return self.start_frame.R_SW @ (end - self.start_frame.origin)

    def _require(self, found: int, what: str) -> None:
        if found < len(self.ticks):
            raise IncompleteRunError(
                f"the run of '{self.plan.motion}' has {what} in {found} of its {len(self.ticks)} ticks; every tick needs one"
            )
