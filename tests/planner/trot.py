"""A robot in the middle of a trot: the states and contact sequences that running take-offs are tested from."""

import numpy as np
import pinocchio as pin

from aerial_model.robot.robot import BASE_TWIST, JOINT_POSITION, JOINT_VELOCITY
from aerial_model.values.contact_sequence import ContactPhase, ContactSequence
from aerial_model.values.estimate import Estimate

LIFT = 0.05  # of a swinging foot above the ground [m]


def pair(robot, *names):
    """Mask ``(n_c,)`` of the contact points of these names."""
    return np.array([point.name in names for point in robot.contact_points])


def moving(robot, speed, loaded, ahead=0.0):
    """State with the trunk at ``speed`` [m/s] forward, loaded feet at rest ``ahead`` of home [m], the others lifted behind it."""
    q = robot.standing_configuration()
    target = robot.contact_positions(q)
    target[loaded] += [ahead, 0.0, 0.0]
    target[~loaded] += [-ahead, 0.0, LIFT]
    q = reaching(robot, q, target)
    J = jacobian(robot, q)
    v = np.zeros(robot.model.nv)
    v[0] = speed
    rows = np.repeat(loaded, 3)
    held = J[rows]
    v[JOINT_VELOCITY] = np.linalg.pinv(held[:, JOINT_VELOCITY], rcond=1e-9) @ -(held[:, BASE_TWIST] @ v[BASE_TWIST])
    return Estimate(time=0.0, q=q, v=v)


def reaching(robot, q, target):
    """Configuration with the trunk where ``q`` has it and the feet at ``target`` ``(n_c, 3)``, by Newton's method."""
    q = q.copy()
    for _ in range(30):
        error = (target - robot.contact_positions(q)).ravel()
        q[JOINT_POSITION] += np.linalg.solve(jacobian(robot, q)[:, JOINT_VELOCITY], error)
    return q


def jacobian(robot, q):
    """Velocities of the contact points by v ``(3 n_c, nv)``."""
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, q)
    pin.updateFramePlacements(robot.model, data)
    axes = pin.LOCAL_WORLD_ALIGNED
    return np.vstack([pin.getFrameJacobian(robot.model, data, f, axes)[:3] for f in robot.contact_frames])


def sequence(robot, q, *phases):
    """Contact sequence of phases (duration, loaded, how far ahead of ``q`` the feet stand), the ground being level."""
    feet = robot.contact_positions(q)
    feet[:, 2] = robot.contact_points[0].radius
    return ContactSequence(
        phases=tuple(
            ContactPhase(duration=duration, contact=loaded, foothold=feet + [ahead, 0.0, 0.0])
            for duration, loaded, ahead in phases
        )
    )
