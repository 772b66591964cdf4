"""A peer on the same jump: crocoddyl's FDDP, in an environment of its own because it needs another Pinocchio.

``crocoddyl_jump.py`` is what runs there; it says what FDDP leaves out of the planner's problem. crocoddyl and its
dependencies are free software (BSD and the like); nothing of them is part of this project.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from aerial_evaluation.bench.environment import Environment, Peer
from aerial_evaluation.bench.samples import Row, measure, percentiles, summary
from aerial_evaluation.bench.scaling import KNOTS
from aerial_evaluation.bench.subject import Subject, usual_request, usual_schedule
from aerial_evaluation.statistics import Distribution
from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Plan
from aerial_planner.motion.motion import load_motion
from aerial_planner.planner import Planner
from aerial_planner.settings import PlannerSettings

PEER = Peer(
    "crocoddyl",
    Path(__file__).with_name("crocoddyl_jump.py"),
    (
        # crocoddyl 3.2.1 crashes with pin 4.1.0
        *("crocoddyl==3.2.1", "libcrocoddyl==3.2.1", "pin==4.0.0", "libpinocchio==4.0.0", "numpy==2.4.6"),
        *("eigenpy==3.13.0", "coal==3.0.3", "libcoal==3.0.3", "example-robot-data==5.0.0"),
        *("example-robot-data-loaders==5.0.0", "jrl-cmakemodules==2.1.0", "cmeel==0.62.0", "cmeel-assimp==6.0.5"),
        *("cmeel-boost==1.90.0", "cmeel-console-bridge==1.0.2.3", "cmeel-octomap==1.10.0", "cmeel-qhull==8.0.2.1"),
        *("cmeel-tinyxml2==11.0.0", "cmeel-urdfdom==6.0.0", "cmeel-zlib==1.3.2"),
    ),
)
_TOLERANCE = 1e-4  # at which FDDP stops, as the planner's solver does
_MAX_ITERATIONS = 100
_WORTH = ("landing_error_m", "landing_tilt_deg", "peak_torque_ratio", "peak_voltage_ratio", "friction_excess")


def crocoddyl(subject: Subject) -> list[Row]:
    """Return one row per jump and number of knots: FDDP's solve alone, and ours from request to checked plan.

    ``speed_ratio`` is one of CPU times, because two processes cannot take turns.

    Raises:
        PeerError: if there is no crocoddyl.
    """
    rows = []
    environment = Environment(PEER)
    for motion in subject.motions:
        if load_motion(motion, subject.robot).rotation is not None:
            continue
        for settings in _settings(subject, motion):
            rows += _rows(subject, motion, settings, environment)
    return rows


def _settings(subject: Subject, motion: str) -> list[PlannerSettings]:
    """Return settings by which the take-off has the ``KNOTS``."""
    usual = subject.planner.settings
    schedule = usual_schedule(motion, subject.robot, usual)
    return [dataclasses.replace(usual, dt=schedule.take_off_time / n) for n in KNOTS]


def _rows(subject: Subject, motion: str, settings: PlannerSettings, environment: Environment) -> list[Row]:
    """Return the row of a motion and step, none if there is no plan that says where and when the peer is to land."""
    request = usual_request(motion, subject.robot)
    planner = Planner(subject.robot, settings=settings, cache=subject.cache, actuator_tolerance=np.inf)
    planner.warm_up(request)
    result = measure(planner, request).result
    if result is None:
        subject.progress(f"crocoddyl: no plan of {motion} in steps of {settings.dt:.4f} s to compare with")
        return []
    plan = result.plan
    knots = int(np.sum(_in_take_off(plan)))
    subject.progress(f"crocoddyl: {motion} with {knots} knots")
    peer = environment.solve(problem(plan, subject.robot, settings, subject.repeats))
    ours = summary([measure(planner, request) for _ in range(subject.repeats)])
    runs = peer["runs"]
    theirs = Distribution.of(run["cpu_time_s"] for run in runs)
    row = {
        "motion": motion,
        "knots": knots,
        "flight_knots": settings.flight_knots,
        "versions": peer["versions"],
        "trials": len(runs),
        "converged": sum(run["converged"] for run in runs),
        **{name: percentiles(run[name] for run in runs) for name in ("solve_time_s", "cpu_time_s", "iterations")},
        **{name: max(run[name] for run in runs) for name in _WORTH},
        "reduced": ours.to_json(),
        "speed_ratio": None if theirs is None or ours.cpu_time is None else theirs.p50 / ours.cpu_time.p50,
    }
    return [row]


def problem(plan: Plan, robot: Robot, settings: PlannerSettings, repeats: int) -> dict[str, Any]:
    """Return the jump of a plan as ``crocoddyl_jump.py`` reads it: plain JSON types, SI units."""
    law = robot.actuators
    low, high = robot.planning_range
    arrays = {
        "q_start": plan.q[0],
        "q_landing": plan.q[-1],
        "contact": plan.contact[_in_take_off(plan)],
        "armature": law.armature,
        "torque_max": law.torque_max,
        "volts_per_torque": law.volts_per_torque,
        "volts_per_speed": law.volts_per_speed,
        "bus_voltage": law.bus_voltage,
        "joint_min": low,
        "joint_max": high,
    }
    return {
        **{name: array.tolist() for name, array in arrays.items()},
        "urdf": robot.description.text,
        "contact_frames": [point.frame for point in robot.contact_points],
        "friction": robot.friction_coefficient,
        "margin": settings.margin,
        "dt": settings.dt,
        "flight_time": plan.landing_time - plan.take_off_time,
        "flight_knots": settings.flight_knots,
        "tolerance": _TOLERANCE,
        "max_iterations": _MAX_ITERATIONS,
        "repeats": repeats,
    }


def _in_take_off(plan: Plan) -> np.ndarray:
    """Return which knots ``(K,)`` have contacts."""
    return np.asarray(plan.contact.any(axis=1))
