"""The kinematic reference of a motion: body path, landing, the legs' path through the flight."""

from aerial_planner.reference.body import Reference, body_reference
from aerial_planner.reference.flight_path import FlightPath

__all__ = ["FlightPath", "Reference", "body_reference"]
