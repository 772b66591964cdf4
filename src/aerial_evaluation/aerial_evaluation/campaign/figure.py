"""A campaign at a glance: the share that lands over a condition, or how near its trials came to the limits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from aerial_evaluation import figures
from aerial_evaluation.campaign.campaign import TrialResult
from aerial_evaluation.campaign.summary import Step
from aerial_evaluation.judgement.landing import POSITION_TOLERANCE_MAX, ROTATION_TOLERANCE, TILT_MAX

LANDED, FAILED = "#1f6f8b", "#c44e33"  # apart in grey and for the colour-blind too
LIMITS = {
    "tilt_deg": (float(np.degrees(TILT_MAX)), "tilt"),
    "position_error_m": (POSITION_TOLERANCE_MAX, "position error"),
    "rotation_error_deg": (float(np.degrees(ROTATION_TOLERANCE)), "rotation error"),
    "peak_torque_ratio": (1.0, "peak torque"),
    "peak_voltage_ratio": (1.0, "peak voltage"),
}
UNITS = {"latency": "latency [s]", "ground_rise": "rise of the ground [m]", "push": "push [N·s]"}
_BEYOND = 1.6  # times a limit: where a dot is drawn that lies farther
_RESOLUTION = 200  # [1/in]


def draw(title: str, done: Sequence[TrialResult], steps: Sequence[Step], file: Path) -> Figure:
    """Draw into a PNG file: the share over the condition that has steps, if one has, and every trial's figures."""
    figure = Figure(figsize=(9.0 if steps else 5.0, 3.6), layout="constrained")
    axes = figure.subplots(1, 2 if steps else 1, squeeze=False)[0]
    if steps:
        _draw_shares(axes[0], steps)
    _draw_limits(axes[-1], done)
    figure.suptitle(title)
    figures.save(figure, file, _RESOLUTION)
    return figure


def _draw_shares(axes: Axes, steps: Sequence[Step]) -> None:
    name = steps[0].name
    with_trials = [step for step in steps if step.group.share.rate is not None]
    value = [step.value for step in with_trials]
    share = 100 * np.array([step.group.share.rate for step in with_trials])
    low, high = 100 * np.array([step.group.share.interval for step in with_trials]).T
    spread = np.array([np.maximum(share - low, 0), np.maximum(high - share, 0)])
    axes.errorbar(value, share, spread, color=LANDED, marker="o", capsize=3)
    axes.set(xlabel=UNITS.get(name, name.replace("_", " ")), ylabel="landed [%]", ylim=(-3, 103))
    axes.grid(alpha=0.3)


def _draw_limits(axes: Axes, done: Sequence[TrialResult]) -> None:
    executed = [(each.landed, each.executed.figures) for each in done if each.executed is not None]
    spread = np.random.default_rng(0)
    for row, (name, (limit, _)) in enumerate(LIMITS.items()):
        for landed, colour in ((True, LANDED), (False, FAILED)):
            values = np.array([of_trial[name] for has_landed, of_trial in executed if has_landed == landed])
            share = np.minimum(values / limit, _BEYOND)
            axes.scatter(share, row + spread.uniform(-0.25, 0.25, len(share)), s=6, color=colour, alpha=0.5)
    axes.axvline(1.0, color="black", linewidth=0.8)
    axes.set_yticks(range(len(LIMITS)), [label for _, label in LIMITS.values()])
    axes.invert_yaxis()
    axes.set(xlabel="share of its limit", xlim=(0.0, _BEYOND + 0.05))
    axes.grid(alpha=0.3, axis="x")
