"""The actuator limits that a plan obeys, and the shares of them that it may use."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from aerial_model.robot.robot import Robot
from aerial_planner.settings import PlannerSettings

_UNLIMITED = 1e3  # share of a limit that no plan reaches


class Variant(StrEnum):
    """The actuator constraints that a plan obeys (thesis section 3.1.3)."""

    KD = "KD"  # none
    AAKD = "AAKD"  # (3.11) with the exact contact Jacobian
    AAKD_STAR = "AAKD*"  # (3.11) with the Jacobian at frozen ab/adduction


@dataclass(frozen=True, kw_only=True)
class Margin:
    """Shares of torque and voltage limits that each joint may use ``(n,)``."""

    take_off: np.ndarray
    flight: np.ndarray  # counts for legs only as the flight begins

    @staticmethod
    def usual(robot: Robot, settings: PlannerSettings) -> Margin:
        """Return the shares of the settings; in flight they limit arms alone, as legs usually have torque to spare there."""
        flight = np.full(robot.n_joints, _UNLIMITED)
        flight[robot.planned_joints[robot.planned.arms]] = settings.margin
        return Margin(take_off=np.full(robot.n_joints, settings.margin), flight=flight)
