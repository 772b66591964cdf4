"""A picture of a motion that was run."""

from __future__ import annotations

from pathlib import Path

from aerial_evaluation.record import IncompleteRunError, Run
from aerial_model.errors import ConfigurationError
from aerial_sim.picture.picture import Footage, save, strobe


def save_picture(run: Run, path: Path) -> None:
    """Draw several moments of a motion into one PNG file.

    Raises:
        IncompleteRunError: if the run does not know its terrain.
        ConfigurationError: if the file cannot be written.
    """
    if run.terrain is None:
        raise IncompleteRunError(f"no picture of '{run.plan.motion}': the run does not say what terrain it was on")
    footage = Footage.of(
        run.robot,
        run.terrain,
        run.time,
        run.q,
        start_time=run.start_time,
        take_off_time=run.plan.take_off_time,
        landing_time=run.plan.landing_time,
    )
    image = strobe(footage)
    try:
        save(image, path)
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be written ({error.strerror})") from None
