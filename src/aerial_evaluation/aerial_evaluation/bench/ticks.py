"""What a tick of the controller takes, part by part: real measurements of a motion, answered once more.

Times are CPU times of the thread: unlike wall times they do not grow with what else the machine does.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerial_evaluation.bench.samples import Row
from aerial_evaluation.bench.subject import Subject, usual_request
from aerial_evaluation.closed_loop import STAND_TIME, Loop
from aerial_evaluation.judgement.landing import OBSERVE_TIME
from aerial_model.robot.robot import Robot
from aerial_model.values.command import Command
from aerial_model.values.measurement import Measurement
from aerial_model.values.plan import Plan
from aerial_sim.simulation import Simulation
from aerial_wbic.controller import Controller
from aerial_wbic.gains import ControllerGains, QpSolver, TaskOrder

PARTS = ("estimate", "kinematics", "target", "hierarchy", "qp", "torque")
MICRO = 1e6  # microseconds in a second


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Measurements of a motion from standing to standing, and the plan that was followed."""

    motion: str
    plan: Plan
    measurements: list[Measurement]
    begin: int  # tick before which the plan was accepted

    def replay(self, controller: Controller) -> Iterator[float]:
        """Let a controller that was reset answer every measurement; yield the time of each answer [s]."""
        for k, measurement in enumerate(self.measurements):
            if k == self.begin:
                controller.accept(self.plan)
            began = time.thread_time()
            controller.step(measurement)
            yield time.thread_time() - began


class RecordingController(Controller):
    """A controller that keeps what it was told."""

    def __init__(self, robot: Robot) -> None:
        self.measurements: list[Measurement] = []
        super().__init__(robot)
        self.measurements.clear()  # those of the rehearsal

    def step(self, measurement: Measurement) -> Command:
        """Keep the measurement, and answer it."""
        self.measurements.append(measurement)
        return super().step(measurement)


class TimedController(Controller):
    """A controller whose parts are timed; ``times`` has each part's sum over a tick [s]."""

    def __init__(self, robot: Robot) -> None:
        self.times: dict[str, list[float]] = {part: [] for part in PARTS}
        self._counted = 0.0  # time of all parts so far [s]
        super().__init__(robot)
        for times in self.times.values():
            times.clear()  # those of the rehearsal
        self._estimator.update = self._timed("estimate", self._estimator.update)
        self._estimator.kinematics.computed = self._timed("kinematics", self._estimator.kinematics.computed)
        self._phases.target = self._timed("target", self._phases.target)
        self._accelerations = self._timed("hierarchy", self._accelerations)
        self._qp.solve = self._timed("qp", self._qp.solve)
        self._qp.within = self._timed("qp", self._qp.within)
        self._drive.exceeds = self._timed("torque", self._drive.exceeds)
        self._drive.room = self._timed("torque", self._drive.room)
        self._drive.command = self._timed("torque", self._drive.command)

    def step(self, measurement: Measurement) -> Command:
        """Answer a measurement, part by part."""
        for times in self.times.values():
            times.append(0.0)
        return super().step(measurement)

    def _timed(self, part: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*args: Any) -> Any:
            within = self._counted
            began = time.thread_time()
            result = call(*args)
            lasted = time.thread_time() - began
            self.times[part][-1] += lasted - (self._counted - within)  # what parts inside of it took is theirs
            self._counted = within + lasted
            return result

        return timed


def record(subject: Subject, motion: str) -> Recording:
    """Return a motion as its controller saw it in closed loop.

    Raises:
        RefusalError: if planner or controller refuse.
    """
    loop = Loop(Simulation(subject.robot, seed=subject.seed), RecordingController(subject.robot))
    loop.advance(STAND_TIME)
    plan = subject.planner.plan(usual_request(motion, subject.robot), loop.controller.estimate).plan
    loop.controller.accept(plan)
    begin = len(loop.controller.measurements)
    loop.advance(plan.landing_time + OBSERVE_TIME)
    return Recording(motion=motion, plan=plan, measurements=loop.controller.measurements, begin=begin)


def ticks(subject: Subject) -> list[Row]:
    """Return a row per motion and solver, and one per motion and order of tasks: a tick's time and that of its parts.

    All answer the measurements of the same closed loop and take turns; the first replay, not counted, warms caches up.
    """
    usual = subject.robot.section("controller", ControllerGains).tasks
    choices = [(usual, solver) for solver in QpSolver]
    choices += [(order, QpSolver.OSQP) for order in TaskOrder if order is not usual]
    robots = [subject.robot.with_section("controller", tasks=order, qp_solver=solver) for order, solver in choices]
    controllers = [Controller(robot) for robot in robots]
    rows = []
    for motion in subject.motions:
        subject.progress(f"ticks of {motion}: recording")
        recording = record(subject, motion)
        totals: list[list[float]] = [[] for _ in robots]
        parts = [{part: [] for part in PARTS} for _ in robots]
        for repeat in range(subject.repeats + 1):
            subject.progress(f"ticks of {motion}: {repeat} of {subject.repeats}")
            for controller, robot, total, part_times in zip(controllers, robots, totals, parts, strict=True):
                controller.reset()
                times = list(recording.replay(controller))
                timed = TimedController(robot)
                for _ in recording.replay(timed):
                    pass
                if repeat:
                    total += times
                    for name, values in timed.times.items():
                        part_times[name] += values
        rows += [
            {
                "motion": motion,
                "tasks": str(order),
                "qp_solver": str(solver),
                "ticks": len(recording.measurements),
                "tick_us": spread(total),
                "parts_us": {name: spread(values) for name, values in part_times.items()},
            }
            for (order, solver), total, part_times in zip(choices, totals, parts, strict=True)
        ]
    return rows


def spread(times: list[float]) -> dict[str, float]:
    """Return median, 99th percentile and maximum of times [s], in microseconds."""
    micros = MICRO * np.array(times)
    return {
        "p50": float(np.percentile(micros, 50)),
        "p99": float(np.percentile(micros, 99)),
        "max": float(micros.max()),
    }
