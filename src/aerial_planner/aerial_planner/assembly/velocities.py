"""Generalized velocities that carry a given momentum exactly, with feet at rest or joints at given rates."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from aerial_model.robot.robot import BASE_TWIST, JOINT_VELOCITY, Robot

_DAMPING = 1e-11  # of normal equations, as a share of their trace


def consistent_velocities(
    robot: Robot, q: np.ndarray, v: np.ndarray, momentum: np.ndarray, held: np.ndarray
) -> np.ndarray:
    """Return the velocities nearest to ``v`` ``(K, nv)`` with these momenta ``(K, 6)``, linear first, and feet ``held`` at rest.

    Rows may depend on each other, as those of all feet of a robot with few joints do: the normal equations are damped, and
    solved a second time for what that left.
    """
    data = robot.model.createData()
    A = np.zeros((len(q), 6 + 3 * robot.n_contacts, robot.model.nv))
    for k in range(len(q)):
        A[k, :6] = pin.computeCentroidalMap(robot.model, data, q[k])
        pin.computeJointJacobians(robot.model, data, q[k])
        pin.updateFramePlacements(robot.model, data)
        for i in np.flatnonzero(held[k]):
            J = pin.getFrameJacobian(robot.model, data, robot.contact_frames[i], pin.LOCAL_WORLD_ALIGNED)
            A[k, 6 + 3 * i : 9 + 3 * i] = J[:3]
    b = np.zeros(A.shape[:2])
    b[:, :6] = momentum
    transposed = A.transpose(0, 2, 1)
    normal = A @ transposed
    normal += _DAMPING * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(A.shape[1])
    for _ in range(2):
        missing = b - np.einsum("kij,kj->ki", A, v)
        v = v + np.einsum("kij,kj->ki", transposed, np.linalg.solve(normal, missing[..., None])[..., 0])
    return v


def flying_velocities(robot: Robot, q: np.ndarray, joint_velocity: np.ndarray, momentum: np.ndarray) -> np.ndarray:
    """Return v ``(K, nv)`` with these joint rates and these momenta ``(K, 6)``, linear first."""
    data = robot.model.createData()
    A = np.array([pin.computeCentroidalMap(robot.model, data, configuration).copy() for configuration in q])
    left = momentum - np.einsum("kij,kj->ki", A[:, :, JOINT_VELOCITY], joint_velocity)
    return np.hstack([np.linalg.solve(A[:, :, BASE_TWIST], left[..., None])[..., 0], joint_velocity])
