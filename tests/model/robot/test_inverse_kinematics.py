"""Damped Gauss–Newton on a planar arm of two links, whose inverse kinematics is known."""

from __future__ import annotations

import numpy as np
import pytest

from aerial_model.robot.inverse_kinematics import least_squares

UPPER, LOWER = 0.2, 0.2  # [m]
LIMITS = (np.array([-3.0, 0.1]), np.array([3.0, 3.0]))  # the elbow bends one way [rad]
TOLERANCE = 1e-6  # [m]


def tip(q):
    """Position of the arm's end and its Jacobian."""
    shoulder, elbow = q[0], q[0] + q[1]
    position = UPPER * np.array([np.cos(shoulder), np.sin(shoulder)]) + LOWER * np.array([np.cos(elbow), np.sin(elbow)])
    by_elbow = LOWER * np.array([-np.sin(elbow), np.cos(elbow)])
    by_shoulder = UPPER * np.array([-np.sin(shoulder), np.cos(shoulder)]) + by_elbow
    return position, np.column_stack([by_shoulder, by_elbow])


def reach(target, start=(0.3, 0.5)):
    """Joint positions that the iteration ends at."""

    def residual(q):
        position, J = tip(q)
        return target - position, J

    return least_squares(residual, np.array(start), LIMITS, iterations=100, step_max=0.3)


@pytest.mark.parametrize("elbow", [0.3, 1.0, 2.5])
@pytest.mark.parametrize("shoulder", [-1.5, 0.0, 1.0])
def test_what_is_in_reach_is_reached_by_the_one_pose_that_can(shoulder, elbow):
    target, _ = tip(np.array([shoulder, elbow]))
    q = reach(target)
    np.testing.assert_allclose(tip(q)[0], target, atol=TOLERANCE)
    np.testing.assert_allclose(q, [shoulder, elbow], atol=1e-4)


def test_a_pose_that_reaches_is_kept():
    q = np.array([0.4, 0.9])
    np.testing.assert_allclose(reach(tip(q)[0], start=q), q, atol=1e-12)


def test_no_joint_leaves_its_limits_on_the_way():
    seen = []

    def residual(q):
        seen.append(q)
        return np.array([0.0, -0.5]) - tip(q)[0], tip(q)[1]

    least_squares(residual, np.array([2.9, 0.2]), LIMITS, iterations=30, step_max=0.3)
    assert np.all((np.array(seen) >= LIMITS[0]) & (np.array(seen) <= LIMITS[1]))
    assert np.abs(np.diff(seen, axis=0)).max() <= 0.3 + 1e-12
