"""Many seeded trials of one motion in closed loop, in parallel, and what share of them lands.

A trial is determined by its seed and its world: any of them can be run again alone, and does the same.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from distributed import Client, LocalCluster, as_completed
from scipy.stats import binomtest

from aerial_evaluation.closed_loop import run
from aerial_evaluation.judgement import consistency, tracking
from aerial_model.config import closest
from aerial_model.errors import AerialError, ConfigurationError, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.codegen.library import default_cache
from aerial_planner.ocp.options import SolverName
from aerial_planner.planner import Planner
from aerial_sim.conditions import Conditions

CONFIDENCE = 0.95  # of the intervals around a share
CONNECT_TIMEOUT = 10.0  # [s] after which there is no scheduler at an address
FIGURES = ("tilt_deg", "position_error_m", "rotation_error_deg", "peak_torque_ratio", "peak_voltage_ratio")


@dataclass(frozen=True, kw_only=True)
class Variation:
    """One condition that is not the same in all trials."""

    name: str
    low: float
    high: float
    steps: int | None = None  # values, equally spaced, each with all seeds; None: drawn for each trial

    def __post_init__(self) -> None:
        if self.name not in Conditions.names():
            known = Conditions.names()
            raise ConfigurationError(
                f"no condition '{self.name}'{closest(self.name, known)}; there are {', '.join(known)}"
            )
        if not self.low <= self.high:
            raise ConfigurationError(f"{self.name}: expected LO not above HI, found {self.low} and {self.high}")
        if self.steps is not None and self.steps < 2:
            raise ConfigurationError(f"{self.name}: expected at least 2 steps, found {self.steps}")

    def drawn(self, seed: int) -> float:
        """Return the value of a trial; the same for the same seed and name."""
        return float(np.random.default_rng([seed, *self.name.encode()]).uniform(self.low, self.high))

    def values(self) -> list[float]:
        """Return the equally spaced values."""
        return np.linspace(self.low, self.high, self.steps).tolist()


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One run."""

    seed: int
    conditions: Conditions


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """What all trials have in common."""

    robot: Robot
    request: MotionRequest
    noise: str = "nominal"
    solver: str = SolverName.RICCATI

    def attempt(self, trial: Trial) -> dict[str, Any]:
        """Return what came of a trial.

        That is: seed, conditions, whether it landed, the reason if not, figures, samples of the estimate's errors
        and of the plan's.
        """
        result = {"seed": trial.seed, "conditions": asdict(trial.conditions), "landed": False}
        try:
            outcome = run(
                self.robot,
                self.request,
                seed=trial.seed,
                noise=self.noise,
                conditions=trial.conditions,
                planner=_planner(pickle.dumps(self.robot), self.solver),
            )
        except RefusalError as refusal:
            return {**result, "reason": f"refused: {refusal.reason}"}
        except AerialError as error:
            return {**result, "reason": str(error)}
        landing = outcome.landing.to_json()
        return {
            **result,
            "landed": landing["landed"],
            "reason": ", ".join(outcome.landing.failed),
            **{name: landing[name] for name in FIGURES},
            "estimate": outcome.estimate,
            "tracking": outcome.tracking,
            "plan_time_s": outcome.planning.report.total_time_s,
            "real_time_factor": outcome.real_time_factor,
        }


@lru_cache(maxsize=1)
def _planner(robot: bytes, solver: str) -> Planner:
    """Return this worker's planner, kept warm from trial to trial."""
    return Planner(pickle.loads(robot), solver=solver, cache=default_cache())


def trials(
    number: int, first_seed: int = 0, variations: Sequence[Variation] = (), base: Conditions | None = None
) -> list[Trial]:
    """Return ``number`` trials at each value of the varied condition that has steps, with the same seeds at each.

    Raises:
        ConfigurationError: if nothing is to be tried, a value makes no sense, or two variations have steps.
    """
    if number < 1:
        raise ConfigurationError(f"expected at least 1 trial, found {number}")
    stepped = [variation for variation in variations if variation.steps is not None]
    if len(stepped) > 1:
        names = " and ".join(variation.name for variation in stepped)
        raise ConfigurationError(f"only one condition can go in steps, found {names}")
    drawn = [variation for variation in variations if variation.steps is None]
    swept: list[dict[str, float]] = [{stepped[0].name: value} for value in stepped[0].values()] if stepped else [{}]
    try:
        return [
            Trial(
                seed=seed,
                conditions=replace(base or Conditions(), **step, **{each.name: each.drawn(seed) for each in drawn}),
            )
            for step in swept
            for seed in range(first_seed, first_seed + number)
        ]
    except ValueError as error:
        raise ConfigurationError(str(error)) from None


def results(campaign: Campaign, todo: Iterable[Trial], client: Client) -> Iterator[dict[str, Any]]:
    """Yield the result of every trial as it comes; one whose worker died counts as not landed."""
    [shared] = client.scatter([campaign], broadcast=True)
    futures = {client.submit(Campaign.attempt, shared, trial, pure=False): trial for trial in todo}
    for future in as_completed(futures):
        trial = futures[future]
        if future.status == "finished":
            yield future.result()
        else:
            failure = {"seed": trial.seed, "conditions": asdict(trial.conditions), "landed": False}
            yield {**failure, "reason": f"the worker failed: {future.exception()!r}"}
        future.release()


@contextmanager
def workers(number: int, scheduler: str | None = None) -> Iterator[Client]:
    """Yield a client of ``number`` worker processes on this machine, or of the cluster at an address.

    Raises:
        ConfigurationError: if there is no scheduler at the address.
    """
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=CONNECT_TIMEOUT)
        except (OSError, ValueError) as error:
            raise ConfigurationError(f"no Dask scheduler answers at '{scheduler}' ({error})") from None
        with client:
            yield client
        return
    cluster = LocalCluster(n_workers=number, threads_per_worker=1, dashboard_address=None, silence_logs="ERROR")
    with cluster, Client(cluster) as client:
        yield client


def summary(done: Sequence[Mapping[str, Any]], variations: Sequence[Variation] = ()) -> dict[str, Any]:
    """Return the shares that landed, of all and by the value of the condition that has steps, and what failed.

    Intervals are Wilson's, at ``CONFIDENCE``.
    """
    done = sorted(done, key=lambda result: (list(result["conditions"].values()), result["seed"]))
    stepped = next((variation for variation in variations if variation.steps is not None), None)
    groups: list[dict[str, Any]] = []
    if stepped is not None:
        for value in stepped.values():
            group = [result for result in done if result["conditions"][stepped.name] == value]
            groups.append({stepped.name: value, **_share(group), "figures": _figures(group)})
    return {
        **_share(done),
        "failures": [
            {"seed": result["seed"], "reason": result["reason"], "conditions": _unusual(result["conditions"])}
            for result in done
            if not result["landed"]
        ],
        "conditions": groups,
        "figures": _figures(done),
        "estimate": consistency.summary([result["estimate"] for result in done if "estimate" in result]),
        "tracking": tracking.summary([result["tracking"] for result in done if "tracking" in result]),
    }


def _figures(done: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Return the spread of every figure over the trials that landed."""
    landed = [result for result in done if result["landed"]]
    return {name: _spread([result[name] for result in landed]) for name in FIGURES} if landed else {}


def _unusual(conditions: Mapping[str, float]) -> dict[str, float]:
    """Return the conditions that are not what is counted on."""
    usual = asdict(Conditions())
    return {name: value for name, value in conditions.items() if value != usual[name]}


def _share(done: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    landed = sum(result["landed"] for result in done)
    if not done:
        return {"trials": 0, "landed": 0, "success_rate": None, "interval95": [0.0, 1.0]}
    interval = binomtest(landed, len(done)).proportion_ci(CONFIDENCE, method="wilson")
    return {
        "trials": len(done),
        "landed": landed,
        "success_rate": landed / len(done),
        "interval95": [float(interval.low), float(interval.high)],
    }


def _spread(values: Sequence[float]) -> dict[str, float]:
    return {"p50": float(np.median(values)), "p95": float(np.percentile(values, 95)), "max": float(max(values))}
