"""The reach as a map: distance by direction seen from above, and platform height over distance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from aerial_evaluation import figures

_COLOUR = "#1f6f8b"
_RESOLUTION = 200  # [1/in]


def draw(rows: Sequence[Mapping[str, Any]], file: Path) -> None:
    """Draw the rows of ``bench.reach.reach`` into a PNG file."""
    flat = [row for row in rows if not row["on_platform"]]
    raised = [row for row in rows if row["on_platform"]]
    figure = Figure(figsize=(8.0, 3.8), layout="constrained")
    around = figure.add_subplot(1, 2, 1, projection="polar")
    around.set_theta_zero_location("N")
    around.set_rlabel_position(200)
    angle = np.deg2rad([row["direction_deg"] for row in flat])
    distance = np.array([row["distance_m"] for row in flat])
    around.fill(angle, distance, facecolor=_COLOUR, alpha=0.2, edgecolor=_COLOUR)
    around.plot(angle, distance, "o", color=_COLOUR, markersize=3)
    around.set_title("flat ground: distance [m]; ahead is up")
    ahead = figure.add_subplot(1, 2, 2)
    ahead.plot([row["distance_m"] for row in raised], [row["height_m"] for row in raised], "o-", color=_COLOUR)
    ahead.set(xlabel="distance of the landing ahead [m]", ylabel="height of the platform [m]", ylim=(0.0, None))
    ahead.grid(alpha=0.3)
    figures.save(figure, file, _RESOLUTION)
