"""The controller's quadratic programs of a real motion, by each solver there is."""

from __future__ import annotations

import copy
import time

import numpy as np

from aerial_evaluation.bench import qp_peers
from aerial_evaluation.bench.samples import Row
from aerial_evaluation.bench.subject import Subject
from aerial_evaluation.bench.ticks import record, spread
from aerial_model.robot.robot import Robot
from aerial_wbic.controller import Controller
from aerial_wbic.force_qp.optimization import ForceOptimization, Solution
from aerial_wbic.force_qp.solvers import SOLVERS
from aerial_wbic.gains import ControllerGains, QpSolver


class ProblemController(Controller):
    """A controller that keeps the programs it states: (state, q̈_cmd, f_cmd, contact) of every tick."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self.problems: list[tuple] = []
        solve = self._qp.solve

        def kept(*problem: np.ndarray) -> Solution:
            self.problems.append(copy.deepcopy(problem))  # the next tick overwrites the state
            return solve(*problem)

        self._qp.solve = kept


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
        controller = ProblemController(subject.robot)
        for _ in recording.replay(controller):
            pass
        problems = [problem for problem in controller.problems if problem[-1].any()]
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
