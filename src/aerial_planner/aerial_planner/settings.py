"""The planner's numbers: one set of weights and margins for all motions, and but for scale for all robots.

They are those below, found on the Mini Cheetah and scaled, unless section ``planner`` of ``robot.yaml`` says otherwise.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from aerial_model.robot.scale import Scale, Unit
from aerial_model.timing import CONTROL_PERIOD

_UNITS = {
    "dt": Unit(time=1),
    "force_max": Unit(mass=1, length=1, time=-2),
    "force_min": Unit(mass=1, length=1, time=-2),
    "swing_clearance": Unit(length=1),
    "swing_rise_time": Unit(time=1),
    "landing_lead": Unit(time=1),
    "settling_time": Unit(time=1),
    "weights.angular_velocity": Unit(time=2),
    "weights.joint_velocity": Unit(time=2),
    "weights.joint_acceleration": Unit(time=4),
    "weights.com": Unit(length=-2),
    "weights.com_velocity": Unit(length=-2, time=2),
    "weights.force": Unit(mass=-2, length=-2, time=4),
    "weights.flight_time": Unit(time=-2),
}


@dataclass(frozen=True, kw_only=True)
class Weights:
    """Q of the cost (3.4), per knot; errors in SI units."""

    orientation: float = 2.0  # also in flight: a tumble about another axis can end in the same attitude [1/rad²]
    joint_position: float = 0.05  # [1/rad²]
    angular_velocity: float = 0.01  # [s²/rad²]
    joint_velocity: float = 1e-3  # [s²/rad²]
    joint_acceleration: float = 1e-6  # keeps rates from jumping between knots [s⁴/rad²]
    com: float = 5.0  # [1/m²]
    com_velocity: float = 0.1  # [s²/m²]
    force: float = 1e-4  # [1/N²]
    flight_time: float = 2000.0  # [1/s²]

    def __post_init__(self) -> None:
        if any(value < 0 for value in vars(self).values()):
            raise ValueError("weights must not be negative")


@dataclass(frozen=True, kw_only=True)
class PlannerSettings:
    """Discretization, margins and weights."""

    dt: float = 0.02  # of the take-off knots [s]; the thesis's 0.01 gains nothing (decision 2)
    flight_knots: int = 16  # intervals of the flight
    margin: float = (
        0.85  # share of torque and voltage limits a plan may use; the rest is for feedback and what (3.14) leaves out
    )
    speed_margin: float = 0.9  # share of the no-load speed a plan may use
    force_max: float = 300.0  # greatest normal force of one contact [N]
    force_min: float = 0.0  # least normal force of one loaded contact [N]
    link_slope: float = (
        0.25  # least slope (sine) of a link that stands on a contact: flatter, it would touch the ground
    )
    swing_clearance: float = 0.02  # of feet in the air from the ground while others push [m]
    swing_rise_time: float = 0.04  # in which a foot that has left the ground reaches it [s]
    reach: float = 0.97  # β of (3.18): share of the longest leg the single-rigid-body stage may use
    landing_lead: float = 0.05  # time by which landing feet are set ahead of the centre of mass along its velocity [s]
    settling_time: float = 0.08  # of the legs' rates after lift-off: no motor stops at once [s]
    weights: Weights = field(default_factory=Weights)

    @staticmethod
    def defaults(scale: Scale) -> dict[str, Any]:
        """Return what a ``robot.yaml`` need not say: the numbers above, scaled."""
        numbers = scale.applied(asdict(PlannerSettings()), _UNITS)
        # A contact that ended within a control period would push until the period is over.
        numbers["dt"] = max(1, round(numbers["dt"] / CONTROL_PERIOD)) * CONTROL_PERIOD
        return numbers
