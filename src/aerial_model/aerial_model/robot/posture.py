"""Postures of a robot that stands level: joint angles that put its contact points where they should be."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from aerial_model.robot.inverse_kinematics import least_squares
from aerial_model.robot.robot import BASE_TWIST, Robot

_ITERATIONS = 60
_STEP_MAX = 0.3  # [rad]
_REACHED = 1e-3  # [m]
_HALVINGS = 10  # of the search for a depth


def points_from_com(robot: Robot, pose: np.ndarray) -> np.ndarray:
    """Return the contact points ``(n_c, 3)`` [m] from the centre of mass of a level robot in ``pose`` ``(n,)`` [rad]."""
    q = np.concatenate([np.zeros(6), [1.0], pose])
    return robot.contact_positions(q) - pin.centerOfMass(robot.model, robot.model.createData(), q)


def reaching(robot: Robot, points: np.ndarray, guess: np.ndarray) -> tuple[np.ndarray, float]:
    """Return joint positions ``(n,)`` [rad] in the planning range that bring the contact points near ``points``.

    Args:
        robot: which stands level.
        points: wanted ``(n_c, 3)`` [m] from the centre of mass.
        guess: where to start ``(n,)`` [rad].

    Returns:
        the joint positions and the greatest distance left [m].
    """
    model, data = robot.model, robot.model.createData()

    def residual(q_j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q = np.concatenate([np.zeros(6), [1.0], q_j])
        error = (points - points_from_com(robot, q_j)).ravel()
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        J_com = pin.jacobianCenterOfMass(model, data, q)
        axes = pin.LOCAL_WORLD_ALIGNED
        J = np.vstack([pin.getFrameJacobian(model, data, f, axes)[:3] - J_com for f in robot.contact_frames])
        return error, J[:, BASE_TWIST.stop :]

    start, limits = np.clip(guess, *robot.planning_range), robot.planning_range
    q_j = least_squares(residual, start, limits, iterations=_ITERATIONS, step_max=_STEP_MAX)
    left = np.linalg.norm(points - points_from_com(robot, q_j), axis=1)
    return q_j, float(left.max())


def crouch_depth(robot: Robot, pose: np.ndarray) -> float:
    """Return how far the centre of mass can sink [m], level and straight down, from over the support in ``pose`` ``(n,)``.

    It ends where a joint leaves its planning range, or the trunk would be on the ground.
    """
    points = points_from_com(robot, pose)
    points -= [*points[:, :2].mean(axis=0), 0.0]
    deepest, q_j = 0.0, pose
    low, high = 0.0, -float(points[:, 2].max())
    for _ in range(_HALVINGS):
        depth = (low + high) / 2
        bent, left = reaching(robot, points + [0.0, 0.0, depth], q_j)
        if left < _REACHED:
            low, deepest, q_j = depth, depth, bent
        else:
            high = depth
    return deepest
