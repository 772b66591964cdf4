"""What an operator asks for: a motion, its goal and the terrain it happens on."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from aerial_model.config import frozen_array
from aerial_model.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class MotionRequest:
    """A motion selection, in the start heading frame (origin: centre of the support on the ground, x: heading, z: up)."""

    motion: str
    displacement: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) of the support centre [m]
    yaw: float = 0.0  # change of heading at landing [rad]
    rotation: float | None = None  # signed turns about the motion's own axis; None: as the motion says
    terrain: Terrain = field(default_factory=Terrain)
    variant: str = "AAKD*"
    warm_start: bool = True
    request_id: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "displacement", frozen_array(self.displacement, "displacement", (3,)))
        if not np.isfinite(self.yaw) or not np.isfinite(self.rotation or 0.0):
            raise ValueError("yaw and rotation must be finite numbers")
