"""Lying: the legs of a robot on the ground fold to the pose from which it rises."""

from __future__ import annotations

import numpy as np

from aerial_wbic.behaviours.lie import FoldTarget


def test_a_fold_goes_from_the_joints_as_they_are_to_the_pose(robot, state_at):
    state = state_at(3)
    fold = FoldTarget(state, 1.0, rate=5.0, pose=robot.poses["tuck"])
    begin, end = fold.at(1.0), fold.at(fold.end + 2.0)
    np.testing.assert_allclose(begin.joint_position, state.q[7:])
    np.testing.assert_allclose(begin.joint_velocity, state.v[6:])
    np.testing.assert_allclose(end.joint_position, robot.poses["tuck"], atol=1e-3)
