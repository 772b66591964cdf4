"""A picture of a motion that was run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aerial_evaluation.judgement.landing import Tick
from aerial_model.errors import ConfigurationError
from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Plan
from aerial_model.values.terrain import Terrain
from aerial_sim.picture.picture import Footage, save, strobe


def save_picture(
    robot: Robot, plan: Plan, terrain: Terrain, ticks: Sequence[Tick], start_time: float, path: Path
) -> None:
    """Draw several moments of a motion into one PNG file.

    Args:
        robot: that moved.
        plan: what it followed.
        terrain: in W.
        ticks: what really happened.
        start_time: when the plan's time 0 was [s].
        path: of the file.

    Raises:
        ConfigurationError: if the file cannot be written.
    """
    footage = Footage.of(
        robot,
        terrain,
        np.array([tick.truth.time for tick in ticks]),
        np.array([tick.truth.q for tick in ticks]),
        start_time=start_time,
        take_off_time=plan.take_off_time,
        landing_time=plan.landing_time,
    )
    image = strobe(footage)
    try:
        save(image, path)
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be written ({error.strerror})") from None
