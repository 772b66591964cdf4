"""The robot as CasADi expressions in base coordinates, and inverse kinematics by them."""

from aerial_planner.kinematics.base_frame import BaseFrameModel, base_frame_model
from aerial_planner.kinematics.inverse_kinematics import InverseKinematics
from aerial_planner.kinematics.quaternion import (
    attitude_error,
    conjugate,
    quaternion_product,
    quaternion_step,
    rotation_matrix,
)

__all__ = [
    "BaseFrameModel",
    "InverseKinematics",
    "attitude_error",
    "base_frame_model",
    "conjugate",
    "quaternion_product",
    "quaternion_step",
    "rotation_matrix",
]
