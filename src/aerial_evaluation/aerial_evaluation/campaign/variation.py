"""Which trials a campaign makes: seeds, and conditions of the world that differ between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerial_evaluation.campaign.campaign import Trial
from aerial_model.config import closest
from aerial_model.errors import ConfigurationError
from aerial_sim.conditions import Conditions


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
        """Return the value of a trial; it is determined by seed and name."""
        return float(np.random.default_rng([seed, *self.name.encode()]).uniform(self.low, self.high))

    def values(self) -> list[float]:
        """Return the equally spaced values; none if it is drawn."""
        return [] if self.steps is None else [float(value) for value in np.linspace(self.low, self.high, self.steps)]


def stepped(variations: Sequence[Variation]) -> Variation | None:
    """Return the variation that goes in steps, if there is one.

    Raises:
        ConfigurationError: if there are several.
    """
    found = [variation for variation in variations if variation.steps is not None]
    if len(found) > 1:
        names = " and ".join(variation.name for variation in found)
        raise ConfigurationError(f"only one condition can go in steps, found {names}")
    return found[0] if found else None


def trials(
    number: int, first_seed: int = 0, variations: Sequence[Variation] = (), base: Conditions | None = None
) -> list[Trial]:
    """Return ``number`` trials at each value of the varied condition that has steps, with the same seeds at each.

    Raises:
        ConfigurationError: if nothing is to be tried, a value makes no sense, or two variations have steps.
    """
    if number < 1:
        raise ConfigurationError(f"expected at least 1 trial, found {number}")
    sweep = stepped(variations)
    drawn = [variation for variation in variations if variation.steps is None]
    steps: list[dict[str, float]] = [{sweep.name: value} for value in sweep.values()] if sweep else [{}]
    try:
        return [
            Trial(
                seed=seed,
                conditions=replace(base or Conditions(), **step, **{each.name: each.drawn(seed) for each in drawn}),
            )
            for step in steps
            for seed in range(first_seed, first_seed + number)
        ]
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
