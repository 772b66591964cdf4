"""How planning time grows with the number of knots, and what it is for other robots."""

from __future__ import annotations

import dataclasses

import numpy as np

from aerial_evaluation.bench.samples import Row, measure, summary
from aerial_evaluation.bench.subject import Subject, usual_request, usual_schedule
from aerial_model.errors import AerialError
from aerial_model.robot.loading import known_robots
from aerial_model.robot.robot import Robot
from aerial_planner.planner import Planner

KNOTS = (20, 40, 80, 160)  # of the take-off


def knots(subject: Subject) -> list[Row]:
    """Return one row per motion and number of take-off knots: the same duration in finer steps."""
    rows = []
    settings = subject.planner.settings
    for motion in subject.motions:
        usual = usual_schedule(motion, subject.robot, settings)
        for wanted in KNOTS:
            dt = usual.take_off_time / wanted
            finer = dataclasses.replace(settings, dt=dt)
            planner = Planner(subject.robot, settings=finer, cache=subject.cache, actuator_tolerance=np.inf)
            subject.progress(f"knots: {motion} with {wanted}")
            row = {"motion": motion, "knots": wanted, "dt_s": dt, "flight_knots": settings.flight_knots}
            rows.append({**row, **_repeated(subject, planner, motion)})
    return rows


def robots(subject: Subject) -> list[Row]:
    """Return one row per robot that comes with the project and motion."""
    rows = []
    for name in known_robots():
        robot = Robot.load(name)
        planner = Planner(robot, cache=subject.cache, actuator_tolerance=np.inf)
        size = {"robot": name, "joints": robot.n_joints, "contacts": robot.n_contacts, "mass_kg": robot.mass}
        for motion in subject.motions:
            subject.progress(f"robots: {motion} of {name}")
            try:
                rows.append({**size, "motion": motion, **_repeated(subject, planner, motion), "unsuited": None})
            except AerialError as error:  # the motion names contacts that this robot does not have
                rows.append({**size, "motion": motion, **summary([]).to_json(), "unsuited": str(error)})
    return rows


def _repeated(subject: Subject, planner: Planner, motion: str) -> Row:
    request = usual_request(motion, subject.robot)
    planner.warm_up(request)
    measure(planner, request)
    return summary([measure(planner, request) for _ in range(subject.repeats)]).to_json()
