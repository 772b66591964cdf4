"""A take-off that begins in motion on the rear feet, while the front ones come down at new footholds."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.robot.robot import BASE_TWIST, JOINT_POSITION, JOINT_VELOCITY
from aerial_planner.formulation import SingleRigidBody
from aerial_planner.kinematics import InverseKinematics, base_frame_model
from aerial_planner.motion.motion import load_motion
from aerial_planner.motion.schedule import contact_schedule
from aerial_planner.motion.start import Start
from aerial_planner.ocp.options import SolverOptions
from aerial_planner.reference.body import body_reference
from aerial_planner.settings import PlannerSettings

from ..conftest import jump

SPEED = 0.3  # of the body as the motion starts [m/s]
RAISED = 0.03  # by which the front feet are off the ground then [m]
AHEAD = np.array([0.04, 0.0, 0.0])  # from where the front feet stood before to where they come down [m]
CLEARANCE = 0.01  # that they keep until they arrive [m]
ON_REAR_FEET = 4  # knots
ON_ALL_FEET = 14


@pytest.fixture(scope="session")
def running(robot):
    """Schedule, reference and the single-rigid-body optimum of a jump out of a run."""
    settings, model = PlannerSettings(), base_frame_model(robot)
    ik = InverseKinematics(robot, model)
    stance = robot.standing_configuration()
    feet = robot.contact_positions(stance)
    front = feet[:, 0] > 0
    contact = np.repeat([~front, np.ones(4, dtype=bool)], [ON_REAR_FEET, ON_ALL_FEET], axis=0)
    usual = contact_schedule(jump(0.4, 0.0), load_motion("jump", robot), robot, settings.dt, settings.flight_knots)
    schedule = dataclasses.replace(
        usual,
        contact=contact,
        phase=np.repeat([0, 1], [ON_REAR_FEET, ON_ALL_FEET]),
        stretch_range=np.ones((len(contact), 2)),
    )
    start = moving_start(robot, ik, stance, feet + RAISED * np.array([0.0, 0.0, 1.0]) * front[:, None], front)
    reference = body_reference(schedule, start, robot, model, ik, settings)
    clearance = np.zeros((len(contact) + 1, 4))
    clearance[1 : ON_REAR_FEET - 1, front] = CLEARANCE
    reference = dataclasses.replace(
        reference,
        foot_position=np.tile(feet + AHEAD * front[:, None], (len(contact) + 1, 1, 1)),
        foot_clearance=clearance,
    )
    srbm = SingleRigidBody(robot, model, ik, settings, SolverOptions())
    guess, solution = srbm.solve(schedule, reference)
    return SimpleNamespace(
        settings=settings,
        model=model,
        front=front,
        start=start,
        schedule=schedule,
        reference=reference,
        guess=guess,
        body_solution=solution,
    )


def moving_start(robot, ik, stance, feet, front):
    """The body moves ahead at ``SPEED``, the feet that are not ``front`` stand."""
    com = pin.centerOfMass(robot.model, robot.model.createData(), stance).copy()
    q, v = stance.copy(), np.zeros(robot.model.nv)
    q[JOINT_POSITION] = ik.solve((feet - com)[None], stance[JOINT_POSITION])[0]
    v[BASE_TWIST][0] = SPEED
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, q)
    pin.updateFramePlacements(robot.model, data)
    frames = [frame for frame, is_front in zip(robot.contact_frames, front, strict=True) if not is_front]
    J = np.vstack([pin.getFrameJacobian(robot.model, data, f, pin.LOCAL_WORLD_ALIGNED)[:3] for f in frames])
    v[JOINT_VELOCITY] = np.linalg.lstsq(J[:, JOINT_VELOCITY], -J @ v, rcond=None)[0]
    return Start(q=q, v=v, contact=~front)


def foot_positions(robot, trajectory):
    """Contact points ``(N+1, n_c, 3)`` [m] in S of a trajectory on the ground, by Pinocchio."""
    data = robot.model.createData()
    positions = []
    for com, quaternion, q_j in zip(trajectory.com, trajectory.orientation, trajectory.joint_position, strict=True):
        q = np.concatenate([np.zeros(3), quaternion, q_j])
        positions.append(robot.contact_positions(q) + com - pin.centerOfMass(robot.model, data, q))
    return np.array(positions)
