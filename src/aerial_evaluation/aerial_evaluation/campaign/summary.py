"""What share of a campaign's trials landed, in each world, and how far they were from the limits."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, astuple, dataclass
from typing import Any

from aerial_evaluation.campaign.campaign import FIGURES, TrialResult
from aerial_evaluation.campaign.variation import Variation, stepped
from aerial_evaluation.judgement import consistency, tracking
from aerial_evaluation.judgement.consistency import EstimateErrors
from aerial_evaluation.judgement.tracking import TrackingErrors
from aerial_evaluation.statistics import Distribution, Share
from aerial_sim.conditions import Conditions


@dataclass(frozen=True, kw_only=True)
class Group:
    """Trials of one world."""

    share: Share  # that landed
    figures: dict[str, Distribution]  # of ``FIGURES``, over the trials that landed

    @staticmethod
    def of(done: Sequence[TrialResult]) -> Group:
        """Return the group of some trials."""
        landed = [each.executed.figures for each in done if each.executed is not None and each.landed]
        spreads = {name: Distribution.of(figures[name] for figures in landed) for name in FIGURES}
        return Group(
            share=Share(trials=len(done), succeeded=len(landed)),
            figures={name: spread for name, spread in spreads.items() if spread is not None},
        )

    def share_to_json(self) -> dict[str, Any]:
        """Return how many landed, with the interval of the share."""
        return {
            "trials": self.share.trials,
            "landed": self.share.succeeded,
            "success_rate": self.share.rate,
            "interval95": list(self.share.interval),
        }

    def figures_to_json(self) -> dict[str, dict[str, float]]:
        """Return median, 95th percentile and maximum of every figure."""
        return {name: spread.figures("p50", "p95", "max") for name, spread in self.figures.items()}


@dataclass(frozen=True, kw_only=True)
class Step:
    """The trials at one value of the condition that goes in steps."""

    name: str  # of the condition
    value: float
    group: Group

    def to_json(self) -> dict[str, Any]:
        """Return the row of the JSON object."""
        return {self.name: self.value, **self.group.share_to_json(), "figures": self.group.figures_to_json()}


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A trial that did not land."""

    seed: int
    reason: str
    conditions: dict[str, float]  # those that are not as expected

    @staticmethod
    def of(result: TrialResult) -> Failure:
        """Return what a trial's failure is told by."""
        expected = asdict(Conditions())
        conditions = asdict(result.trial.conditions)
        unusual = {name: value for name, value in conditions.items() if value != expected[name]}
        return Failure(seed=result.trial.seed, reason=result.reason, conditions=unusual)


@dataclass(frozen=True, kw_only=True)
class CampaignSummary:
    """A campaign's figures."""

    all: Group
    steps: tuple[Step, ...]  # one for each value of the condition that has steps
    failures: tuple[Failure, ...]
    estimate: dict[str, EstimateErrors]  # phase → errors of the estimate
    tracking: dict[str, TrackingErrors]  # phase → distances from the plan

    def to_json(self) -> dict[str, Any]:
        """Return the figures as ``./aerial campaign --json`` prints them."""
        return {
            **self.all.share_to_json(),
            "failures": [asdict(failure) for failure in self.failures],
            "conditions": [step.to_json() for step in self.steps],
            "figures": self.all.figures_to_json(),
            "estimate": {phase: errors.to_json() for phase, errors in self.estimate.items()},
            "tracking": {phase: errors.to_json() for phase, errors in self.tracking.items()},
        }


def summary(done: Iterable[TrialResult], variations: Sequence[Variation] = ()) -> CampaignSummary:
    """Return the shares that landed, of all and by the value of the condition that has steps, and what failed."""
    done = sorted(done, key=lambda result: (astuple(result.trial.conditions), result.trial.seed))
    executed = [result.executed for result in done if result.executed is not None]
    sweep = stepped(variations)
    return CampaignSummary(
        all=Group.of(done),
        steps=() if sweep is None else tuple(_step(done, sweep.name, value) for value in sweep.values()),
        failures=tuple(Failure.of(result) for result in done if not result.landed),
        estimate=consistency.summary([each.estimate for each in executed]),
        tracking=tracking.summary([each.tracking for each in executed]),
    )


def _step(done: Sequence[TrialResult], name: str, value: float) -> Step:
    members = [result for result in done if getattr(result.trial.conditions, name) == value]
    return Step(name=name, value=value, group=Group.of(members))
