"""How a world differs from the one that planner and controller count on."""

from __future__ import annotations

from dataclasses import dataclass, fields

from aerial_sim.world.world import FRICTION_COEFFICIENT

PHYSICS_STEP = 0.0005  # [s]


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """One world; the defaults are what is counted on.

    Ground rise and push happen in the middle of a flight: whoever runs the simulation lets them.
    """

    mass: float = 1.0  # of the robot over its model's; the difference sits at the trunk's centre of mass
    friction: float = FRICTION_COEFFICIENT  # coefficient of the ground
    latency: float = 0.0  # from a command to its effect, in whole physics steps [s]
    lost_commands: float = 0.0  # share of commands that never arrive; the motor boards keep the last
    battery: float = 1.0  # voltage over the nominal
    battery_resistance: float = 0.0  # by which the voltage sags under load [Ω]
    ground_rise: float = 0.0  # of the ground while the robot is in the air [m]
    push: float = 0.0  # on the trunk at the apex, level, in a direction drawn from the seed [N·s]
    physics_step: float = PHYSICS_STEP  # of the simulator itself; the ground is as hard as it allows [s]

    def __post_init__(self) -> None:
        for name in ("mass", "friction", "battery", "physics_step"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, found {getattr(self, name)}")
        for name in ("latency", "battery_resistance"):
            if not getattr(self, name) >= 0:
                raise ValueError(f"{name} must not be negative, found {getattr(self, name)}")
        if not 0 <= self.lost_commands < 1:
            raise ValueError(f"lost_commands must be a share from 0 to below 1, found {self.lost_commands}")

    @staticmethod
    def names() -> list[str]:
        """Return what can be varied."""
        return [field.name for field in fields(Conditions)]
