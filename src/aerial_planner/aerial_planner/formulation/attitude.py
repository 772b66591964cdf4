"""Constraints on attitudes, which quaternions state twice: q and −q are the same one."""

from __future__ import annotations

import casadi as ca
import numpy as np

from aerial_planner.kinematics.quaternion import conjugate, quaternion_product
from aerial_planner.ocp.stage import Rows

_SAME_TURN = 0.5  # least q_goal · q of an attitude that is the goal's


def require_attitude(rows: Rows, quaternion: ca.SX, goal: ca.SX) -> None:
    """Add the constraint that a quaternion is the goal, and not its negative, which is a full turn away.

    Args:
        rows: to be added to.
        quaternion: xyzw ``(4,)``, an expression of states.
        goal: xyzw ``(4,)``.
    """
    error = quaternion_product(conjugate(goal), quaternion)
    rows.equal("landing attitude", error[:3])
    rows.between("landing attitude", error[3], _SAME_TURN, np.inf)
