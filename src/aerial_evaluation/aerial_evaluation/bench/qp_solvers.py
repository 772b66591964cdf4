"""The controller's quadratic programs of a real motion, by each solver there is."""

from __future__ import annotations

import copy
import time
from typing import NamedTuple

import numpy as np

from aerial_evaluation.bench import qp_peers
from aerial_evaluation.bench.samples import Row
from aerial_evaluation.bench.subject import Subject
from aerial_evaluation.bench.ticks import Recording, record, spread
from aerial_model.kinematics import Configuration, Kinematics
from aerial_model.robot.robot import Robot
from aerial_wbic.controller import Controller
from aerial_wbic.force_qp.optimization import ForceOptimization, Solution
from aerial_wbic.force_qp.solvers import SOLVERS
from aerial_wbic.gains import ControllerGains, QpSolver
from aerial_wbic.target import WholeBodyTarget


class Problem(NamedTuple):
    """What ``ForceOptimization.solve`` is asked in one tick."""

    state: Configuration
    vdot_cmd: np.ndarray  # (nv,)
    f_cmd: np.ndarray  # (n_c, 3) [N]
    contact: np.ndarray  # (n_c,) bool


def problems_of(recording: Recording, robot: Robot) -> list[Problem]:
    """Return the problems of a recording's ticks with contact, states computed anew from the estimates."""
    controller, kinematics = Controller(robot), Kinematics(robot)
    problems = []
    for _ in recording.replay(controller):
        trace = controller.trace
        if trace.vdot_cmd is not None and isinstance(trace.target, WholeBodyTarget) and trace.target.contact.any():
            state = kinematics.at(trace.estimate.q, trace.estimate.v)
            problems.append(Problem(state, trace.vdot_cmd, trace.target.force, trace.target.contact))
    return problems


def solvers(subject: Subject) -> list[Row]:
    """Return a row per motion and solver: its time for what the ticks with contact ask, from numbers to forces.

    Peers that are installed take part (``qp_peers``). The solvers take turns at every problem.
    ``greatest_difference_n`` is that of any force to OSQP's [N].
    """
    gains = subject.robot.section("controller", ControllerGains)
    factories = {str(solver): factory for solver, factory in SOLVERS.items()} | qp_peers.installed()
    if qp_peers.absent():
        subject.progress(f"solvers: to compare with more, pip install {' '.join(qp_peers.absent())}")
    rows = []
    for motion in subject.motions:
        subject.progress(f"solvers of {motion}: recording")
        recording = record(subject, motion)
        problems = problems_of(recording, subject.robot)
        optimizations = {
            solver: ForceOptimization(subject.robot, gains.weight_base, gains.weight_force, factory)
            for solver, factory in factories.items()
        }
        times: dict[str, list[float]] = {solver: [] for solver in factories}
        found: dict[str, list[Solution]] = {solver: [] for solver in factories}
        for repeat in range(subject.repeats + 1):
            subject.progress(f"solvers of {motion}: {repeat} of {subject.repeats}")
            for problem in problems:
                for solver, optimization in optimizations.items():
                    began = time.thread_time()
                    solution = optimization.solve(*problem)
                    elapsed = time.thread_time() - began
                    if repeat:
                        times[solver].append(elapsed)
                        found[solver].append(copy.deepcopy(solution))  # the next overwrites it
        rows += [
            {
                "motion": motion,
                "qp_solver": solver,
                "problems": len(problems),
                "solved": sum(solution.solved for solution in found[solver]),
                "trials": len(found[solver]),
                "time_us": spread(times[solver]),
                "greatest_difference_n": max(
                    float(np.abs(one.force - other.force).max())
                    for one, other in zip(found[solver], found[QpSolver.OSQP], strict=True)
                ),
            }
            for solver in factories
        ]
    return rows
