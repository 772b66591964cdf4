"""The support: the load is shared without turning the body, and no more is asked of it than it can give."""

from __future__ import annotations

import numpy as np
import pytest

from aerial_model.numerics import rotation
from aerial_wbic.behaviours.support import shared_load, supported

GRAVITY = 9.81  # [m/s²]
FORCE_TOLERANCE = 0.05  # [N], the regularization's part
MOMENT_TOLERANCE = 0.05  # [N·m]


def moments(state, force):
    return np.cross(state.contact_positions - state.com, force).sum(axis=0)


@pytest.mark.parametrize("acceleration", [[0, 0, 0], [1.0, -0.5, 3.0], [0, 0, -9.0]])
def test_the_load_is_shared_without_turning_the_body(robot, state_at, acceleration):
    state = state_at(moving=False)
    force = np.empty((4, 3))
    shared_load(state, np.array(acceleration), force)
    total = robot.mass * (np.array(acceleration) + [0, 0, GRAVITY])
    np.testing.assert_allclose(force.sum(axis=0), total, atol=FORCE_TOLERANCE)
    np.testing.assert_allclose(moments(state, force), 0.0, atol=MOMENT_TOLERANCE)
    assert force[:, 2].min() >= 0


def test_no_share_is_negative_when_the_body_leans_out(state_at):
    state = state_at(moving=False)
    force = np.empty((4, 3))
    shared_load(state, np.array([8.0, 0.0, 0.0]), force)
    assert force[:, 2].min() >= 0


@pytest.mark.parametrize("seed", range(20))
def test_a_supported_acceleration_is_one_that_the_contact_points_give_without_turning_the_body(state_at, seed):
    state = state_at(seed, moving=False)
    wanted = np.random.default_rng(seed).uniform(-8, 8, 3)
    given = supported(state, wanted)
    force = state.mass * (given + [0.0, 0.0, GRAVITY])
    points = state.contact_positions
    meets = state.com[:2] - force[:2] / force[2] * (state.com[2] - points[:, 2].mean())
    ahead = rotation.matrix(rotation.about_z(rotation.heading(state.base_orientation)))[:2, :2]
    along, extent = meets @ ahead, points[:, :2] @ ahead
    middle, half = (extent.max(axis=0) + extent.min(axis=0)) / 2, np.ptp(extent, axis=0) / 2
    assert np.all(np.abs(along - middle) <= 0.81 * half)
    assert given[2] == wanted[2]
    np.testing.assert_allclose(supported(state, given), given, atol=1e-9)
