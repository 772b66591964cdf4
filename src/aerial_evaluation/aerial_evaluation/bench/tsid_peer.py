"""A peer of the tick: TSID, task-space inverse dynamics in C++, in an environment of its own.

``tsid_ticks.py`` is what runs there. TSID's wheel crashes beside Pinocchio 4, so it is built, which takes a compiler and some
minutes. TSID and its dependencies are free software (BSD and the like); nothing of them is part of this project.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from aerial_evaluation.bench.environment import Environment, Peer
from aerial_evaluation.bench.samples import Row
from aerial_evaluation.bench.subject import Subject
from aerial_evaluation.bench.ticks import Recording, part_durations, record, spread
from aerial_model.robot.robot import Robot
from aerial_wbic.controller import Controller
from aerial_wbic.gains import ControllerGains, QpSolver
from aerial_wbic.stopwatch import Part
from aerial_wbic.target import WholeBodyTarget
from aerial_wbic.trace import TickTrace

PEER = Peer(
    "tsid",
    Path(__file__).with_name("tsid_ticks.py"),
    (
        *("pin[build]==4.1.0", "libpinocchio[build]==4.1.0", "eiquadprog[build]==1.3.2", "cmeel[build]==0.62.0"),
        *("jrl-cmakemodules==2.1.0", "scipy==1.17.1"),
    ),
    ("libtsid==1.10.0", "tsid==1.10.0"),
)


def tsid(subject: Subject) -> list[Row]:
    """Return a row per motion and solver: our tick and TSID's, of the ticks with every point on the ground.

    TSID gets the state and the same tasks at the same numbers, so it is to be compared with what our tick does after it has
    estimated (``after_estimate_us``: kinematics, tasks, program, torques); ``speed_ratio`` is TSID's median over that.
    The two take turns, replay by replay.

    Raises:
        PeerError: if there is no TSID.
    """
    environment = Environment(PEER)
    rows = []
    for motion in subject.motions:
        subject.progress(f"tsid: recording {motion}")
        recording = record(subject, motion)
        for solver in QpSolver:
            rows.append(_row(subject, recording, solver, environment))
    return rows


def _row(subject: Subject, recording: Recording, solver: QpSolver, environment: Environment) -> Row:
    robot = subject.robot.with_section("controller", qp_solver=solver)
    whole, after, peers = [], [], []
    controller = Controller(robot)
    traces = [controller.trace for _ in recording.replay(controller)]
    followed = np.array([isinstance(each.target, WholeBodyTarget) and each.target.contact.all() for each in traces])
    asked = problem(robot, [traces[k] for k in np.flatnonzero(followed)])
    for repeat in range(subject.repeats + 1):
        subject.progress(f"tsid: {recording.motion} with {solver}, {repeat} of {subject.repeats}")
        controller.reset()
        ticks = np.array(list(recording.replay(controller)))
        estimating = np.array(part_durations(recording, robot)[Part.ESTIMATE])
        answer = environment.solve(asked)
        if repeat:  # the first warms caches up
            whole += ticks[followed].tolist()
            after += (ticks - estimating)[followed].tolist()
            peers += answer["times_s"]
    row = {
        "motion": recording.motion,
        "qp_solver": str(solver),
        "versions": answer["versions"],
        "ticks": int(np.sum(followed)),
        "solved": answer["solved"],
        "tick_us": spread(whole),
        "after_estimate_us": spread(after),
        "peer_us": spread(peers),
    }
    row["speed_ratio"] = row["peer_us"]["p50"] / row["after_estimate_us"]["p50"]
    return row


def problem(robot: Robot, traces: list[TickTrace]) -> dict[str, Any]:
    """Return ticks with a whole-body target as ``tsid_ticks.py`` reads them: plain JSON types, SI units, W's axes."""
    gains = robot.section("controller", ControllerGains)
    targets = [trace.target for trace in traces if isinstance(trace.target, WholeBodyTarget)]
    rows = {
        "q": [trace.estimate.q for trace in traces],
        "v": [trace.estimate.v for trace in traces],
        "com": [np.concatenate(target.body[:3]) for target in targets],  # with velocity and acceleration
        "orientation": [target.body.orientation for target in targets],
        "angular": [
            np.concatenate([target.body.angular_velocity, target.body.angular_acceleration]) for target in targets
        ],
        "joints": [target.joint_position for target in targets],
    }
    return {
        **{name: np.array(values).tolist() for name, values in rows.items()},
        "urdf": robot.description.text,
        "contact_frames": [point.frame for point in robot.contact_points],
        "friction": robot.friction_coefficient,
        "armature": robot.actuators.armature.tolist(),
        "torque_max": np.array(robot.actuators.torque_max).tolist(),
        "stiffness": float(gains.hold.position.stiffness),
        "damping": float(gains.hold.position.damping),
    }
