"""What a tick of the controller takes, part by part: real measurements of a motion, answered once more.

Times are CPU times of the thread: unlike wall times they do not grow with what else the machine does.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from aerial_evaluation.bench.samples import Row
from aerial_evaluation.bench.subject import Subject, usual_request
from aerial_evaluation.closed_loop import STAND_TIME
from aerial_evaluation.judgement.landing import OBSERVE_TIME
from aerial_model.robot.robot import Robot
from aerial_model.values.measurement import Measurement
from aerial_model.values.plan import Plan
from aerial_sim.simulation import Simulation
from aerial_wbic.controller import Controller
from aerial_wbic.gains import ControllerGains, QpSolver, TaskOrder
from aerial_wbic.stopwatch import Part

MICRO = 1e6  # microseconds in a second


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Measurements of a motion from standing to standing, and the plan that was followed."""

    motion: str
    plan: Plan
    measurements: list[Measurement]
    begin: int  # tick before which the plan was accepted

    def replay(self, controller: Controller) -> Iterator[float]:
        """Hand every measurement to a controller that was reset; yield the time of each answer [s].

        After each of them ``controller.trace`` is that tick's.
        """
        for k, measurement in enumerate(self.measurements):
            if k == self.begin:
                controller.accept(self.plan)
            began = time.thread_time()
            controller.step(measurement)
            yield time.thread_time() - began


def record(subject: Subject, motion: str) -> Recording:
    """Return a motion as its controller saw it in closed loop.

    Raises:
        RefusalError: if planner or controller refuse.
    """
    simulation, controller = Simulation(subject.robot, seed=subject.seed), Controller(subject.robot)
    measurements: list[Measurement] = []

    def advance(duration: float) -> None:
        for _ in range(round(duration / simulation.control_dt)):
            measurements.append(simulation.measure())
            simulation.step(controller.step(measurements[-1]))

    advance(STAND_TIME)
    plan = subject.planner.plan(usual_request(motion, subject.robot), controller.estimate).plan
    controller.accept(plan)
    begin = len(measurements)
    advance(plan.landing_time + OBSERVE_TIME)
    return Recording(motion=motion, plan=plan, measurements=measurements, begin=begin)


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
        parts: list[dict[Part, list[float]]] = [{part: [] for part in Part} for _ in robots]
        for repeat in range(subject.repeats + 1):
            subject.progress(f"ticks of {motion}: {repeat} of {subject.repeats}")
            for controller, robot, total, part_times in zip(controllers, robots, totals, parts, strict=True):
                controller.reset()
                times = list(recording.replay(controller))
                durations = part_durations(recording, robot)
                if repeat:
                    total += times
                    for part, values in durations.items():
                        part_times[part] += values
        rows += [
            {
                "motion": motion,
                "tasks": str(order),
                "qp_solver": str(solver),
                "ticks": len(recording.measurements),
                "tick_us": spread(total),
                "parts_us": {str(part): spread(values) for part, values in part_times.items()},
            }
            for (order, solver), total, part_times in zip(choices, totals, parts, strict=True)
        ]
    return rows


def part_durations(recording: Recording, robot: Robot) -> dict[Part, list[float]]:
    """Return how long each part of each of a recording's ticks takes [s], of a controller that is timed."""
    controller = Controller(robot, clock=time.thread_time)
    durations: dict[Part, list[float]] = {part: [] for part in Part}
    for _ in recording.replay(controller):
        for part, duration in controller.trace.durations.items():
            durations[part].append(duration)
    return durations


def spread(times: list[float]) -> dict[str, float]:
    """Return median, 99th percentile and maximum of times [s], in microseconds."""
    micros = MICRO * np.array(times)
    return {
        "p50": float(np.percentile(micros, 50)),
        "p99": float(np.percentile(micros, 99)),
        "max": float(micros.max()),
    }
