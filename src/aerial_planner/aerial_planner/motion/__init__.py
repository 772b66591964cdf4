"""Motions as data, where they start, and the contact schedule of a request."""

from aerial_planner.motion.motion import (
    FlightRule,
    Motion,
    Phase,
    RotationRule,
    known_motions,
    load_motion,
    motions_folder,
)
from aerial_planner.motion.schedule import Schedule, contact_bits, contact_schedule, flight_time
from aerial_planner.motion.start import Start

__all__ = [
    "FlightRule",
    "Motion",
    "Phase",
    "RotationRule",
    "Schedule",
    "Start",
    "contact_bits",
    "contact_schedule",
    "flight_time",
    "known_motions",
    "load_motion",
    "motions_folder",
]
