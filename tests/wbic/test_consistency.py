"""A consistent plan's velocities obey its own momentum and its own fixed feet."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aerial_model.kinematics import Kinematics
from aerial_model.robot import JOINT_VELOCITY
from aerial_wbic.consistency import consistent
from aerial_wbic.tasks import Limbs

ROUNDING = 1e-6


@pytest.fixture
def rough(hop):
    """The hop with velocities 5 % off, as Euler steps leave them."""
    random = np.random.default_rng(0)
    return dataclasses.replace(hop, v=hop.v + 0.05 * random.normal(size=hop.v.shape))


def test_momentum_and_fixed_feet_are_kept(robot, rough):
    plan = consistent(rough, Kinematics(robot), Limbs(robot))
    kinematics = Kinematics(robot)
    pushing = plan.contact.any(axis=1).sum()
    for k, contact in enumerate(plan.contact[: pushing + 1]):
        state = kinematics.at(plan.q[k], plan.v[k])
        momentum = np.concatenate([plan.angular_momentum[k], robot.mass * plan.com_velocity[k]])
        np.testing.assert_allclose(state.A_G @ plan.v[k], momentum, atol=ROUNDING)
        np.testing.assert_allclose(state.J_contacts[contact] @ plan.v[k], 0.0, atol=ROUNDING)


def test_swinging_limbs_keep_their_velocities(robot, rough):
    plan = consistent(rough, Kinematics(robot), Limbs(robot))
    flying = ~plan.contact.any(axis=1)
    np.testing.assert_allclose(plan.v[flying][:, JOINT_VELOCITY], rough.v[flying][:, JOINT_VELOCITY], atol=ROUNDING)


def test_nothing_but_velocities_changes(robot, rough):
    plan = consistent(rough, Kinematics(robot), Limbs(robot))
    for field in dataclasses.fields(plan):
        if field.name != "v":
            assert getattr(plan, field.name) is getattr(rough, field.name)
