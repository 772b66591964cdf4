"""What a planner benchmark measures, and how often."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from aerial_model.errors import ConfigurationError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.formulation.limits import Variant
from aerial_planner.motion.motion import known_motions, load_motion
from aerial_planner.motion.schedule import Schedule, contact_schedule
from aerial_planner.planner import Planner
from aerial_planner.settings import PlannerSettings

FORWARD = (
    0.4  # where a motion goes that neither turns nor travels unless told to, for a robot of the reference size [m]
)


@dataclass(frozen=True, kw_only=True)
class Subject:
    """One robot, its motions, and how often each is planned."""

    robot: Robot
    motions: tuple[str, ...]
    repeats: int = 10
    goals: int = 50  # of each kind
    seed: int = 0
    folder: Path = Path("out/bench")  # for figures
    cache: Path | None = None  # of compiled functions; None: interpreted ones
    progress: Callable[[str], None] = field(default=lambda _: None)  # told what is measured now

    def __post_init__(self) -> None:
        for motion in self.motions:
            load_motion(motion, self.robot)
        for name in ("repeats", "goals"):
            if getattr(self, name) < 1:
                raise ConfigurationError(f"{name}: expected at least 1, found {getattr(self, name)}")

    @cached_property
    def planner(self) -> Planner:
        """A planner that shows what a plan asks of the actuators instead of refusing it."""
        return Planner(self.robot, cache=self.cache, actuator_tolerance=np.inf)


def motions_of(robot: Robot) -> tuple[str, ...]:
    """Return the known motions that name no contact the robot does not have, those that turn least first."""
    rules = {name: load_motion(name, robot).rotation for name in known_motions(robot) if _suits(name, robot)}
    turns = {name: 0.0 if rule is None else rule.turns for name, rule in rules.items()}
    return tuple(sorted(turns, key=lambda name: (turns[name], name)))


def _suits(motion: str, robot: Robot) -> bool:
    try:
        usual_schedule(motion, robot, robot.section("planner", PlannerSettings))
    except ConfigurationError:
        return False
    return True


def usual_schedule(motion: str, robot: Robot, settings: PlannerSettings) -> Schedule:
    """Return the contact schedule of a motion's usual request."""
    said = load_motion(motion, robot)
    return contact_schedule(usual_request(motion, robot), said, robot, settings.dt, settings.flight_knots)


def usual_request(
    motion: str, robot: Robot, variant: Variant = Variant.AAKD_STAR, *, warm_start: bool = True
) -> MotionRequest:
    """Return the motion as its file says; one that would stay where it is goes ``FORWARD``."""
    said = load_motion(motion, robot)
    stays = said.rotation is None and not np.any(said.displacement)
    return MotionRequest(
        motion=motion,
        displacement=np.array([FORWARD * robot.scale.length if stays else 0.0, 0.0, 0.0]),
        variant=variant.value,
        warm_start=warm_start,
    )
