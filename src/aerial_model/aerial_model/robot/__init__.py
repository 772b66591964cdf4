"""A robot as data: its folder, its model, its actuators and contact points."""

from aerial_model.robot.actuator import ActuatorLaw
from aerial_model.robot.contact import ContactPoint, friction_pyramid
from aerial_model.robot.robot import (
    BASE_ANGULAR,
    BASE_LINEAR,
    BASE_ORIENTATION,
    BASE_POSITION,
    BASE_TWIST,
    GRAVITY,
    JOINT_POSITION,
    JOINT_VELOCITY,
    Robot,
)
from aerial_model.robot.scale import Scale

__all__ = [
    "BASE_ANGULAR",
    "BASE_LINEAR",
    "BASE_ORIENTATION",
    "BASE_POSITION",
    "BASE_TWIST",
    "GRAVITY",
    "JOINT_POSITION",
    "JOINT_VELOCITY",
    "ActuatorLaw",
    "ContactPoint",
    "Robot",
    "Scale",
    "friction_pyramid",
]
