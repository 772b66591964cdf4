"""The reach as a map: distance by direction seen from above, and platform height over distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from aerial_evaluation import figures

_COLOUR = "#1f6f8b"
_RESOLUTION = 200  # [1/in]


@dataclass(frozen=True, kw_only=True)
class End:
    """How far a goal may go: by direction on flat ground, or in height at one distance of a platform ahead."""

    direction_deg: float
    on_platform: bool
    distance_m: float
    height_m: float
    binds: str  # why the goal just beyond is refused


def draw(ends: Sequence[End], file: Path) -> Figure:
    """Draw a map of the reach into a PNG file."""
    flat = [end for end in ends if not end.on_platform]
    raised = [end for end in ends if end.on_platform]
    figure = Figure(figsize=(8.0, 3.8), layout="constrained")
    around: Any = figure.add_subplot(1, 2, 1, projection="polar")  # polar axes have methods of their own
    around.set_theta_zero_location("N")
    around.set_rlabel_position(200)
    angle = np.deg2rad([end.direction_deg for end in flat])
    distance = np.array([end.distance_m for end in flat])
    around.fill(angle, distance, facecolor=_COLOUR, alpha=0.2, edgecolor=_COLOUR)
    around.plot(angle, distance, "o", color=_COLOUR, markersize=3)
    around.set_title("flat ground: distance [m]; ahead is up")
    ahead = figure.add_subplot(1, 2, 2)
    ahead.plot([end.distance_m for end in raised], [end.height_m for end in raised], "o-", color=_COLOUR)
    ahead.set(xlabel="distance of the landing ahead [m]", ylabel="height of the platform [m]", ylim=(0.0, None))
    ahead.grid(alpha=0.3)
    figures.save(figure, file, _RESOLUTION)
    return figure
