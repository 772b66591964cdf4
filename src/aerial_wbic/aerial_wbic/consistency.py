"""A plan whose velocities agree with its own momentum and its own fixed feet.

The planner's Euler steps leave generalized velocities that violate both by some 5 %: on the roll axis that is 20° of
attitude after a barrel roll. At every knot the velocity nearest to the planned one is taken that meets

    [A_G; J_stance; S_swing] q̇ = [α; m ṙ; 0; q̇_swing].
"""

from __future__ import annotations

import dataclasses

import numpy as np

from aerial_model.kinematics import Kinematics
from aerial_model.plan import Plan
from aerial_model.robot import JOINT_VELOCITY
from aerial_wbic.tasks import Limbs

RANK_THRESHOLD = 1e-6  # relative to the largest singular value


def consistent(plan: Plan, kinematics: Kinematics, limbs: Limbs) -> Plan:
    """Return ``plan`` with such velocities ``v`` ``(K, nv)`` until the last contact has ended; all else is unchanged.

    In the flight that follows nothing depends on the base's velocity, and the joints keep theirs.
    """
    mass = kinematics.robot.mass
    v = plan.v.copy()
    pushing = plan.contact.any(axis=1)
    for k in np.flatnonzero(pushing | np.roll(pushing, 1)):  # the knot that ends the last contact too
        contact = plan.contact[k]
        state = kinematics.at(plan.q[k], plan.v[k])
        swinging = limbs.swinging(contact)
        S = np.zeros((len(swinging), len(v[k])))
        S[:, JOINT_VELOCITY][np.arange(len(swinging)), swinging] = 1.0
        J = np.vstack([state.A_G, *(state.J_c(i) for i in np.flatnonzero(contact)), S])
        b = np.zeros(len(J))
        b[:3], b[3:6] = plan.angular_momentum[k], mass * plan.com_velocity[k]
        b[len(b) - len(swinging) :] = plan.v[k][JOINT_VELOCITY][swinging]
        v[k] += np.linalg.lstsq(J, b - J @ v[k], rcond=RANK_THRESHOLD)[0]
    return dataclasses.replace(plan, v=v)
