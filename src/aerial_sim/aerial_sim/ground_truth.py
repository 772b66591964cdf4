"""What the simulator knows and a robot could not: read by evaluation, pictures and tests, never by a controller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundTruth:
    """State at one control instant; contacts and torques over the control period that led to it.

    A touch counts however short: flags are set by any physics step of the period. Forces are those of its last step.
    """

    time: float  # [s]
    q: np.ndarray  # (nq,) base position in W [m], quaternion xyzw, joints [rad]
    v: np.ndarray  # (nv,) base twist in B, linear first [m/s, rad/s], joints [rad/s]
    contact: np.ndarray  # (n_c,) bool, the contact point touched the world
    force: np.ndarray  # (n_c, 3) of the world on the robot, in W [N]
    other_contacts: tuple[str, ...]  # links that touched the world elsewhere than at a contact point
    trunk_contact: bool  # the root link did
    requested_torque: np.ndarray  # (n,) mean of what the motor boards were asked for, before any limit [N·m]
    delivered_torque: np.ndarray  # (n,) mean of what they gave [N·m]
    peak_torque_ratio: float  # largest requested torque over its limit, over joints and physics steps
    peak_voltage_ratio: float  # largest voltage that the requested torque needs, over the bus voltage
