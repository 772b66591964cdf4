"""One motion in closed loop, in one process and without ROS: stand, plan, execute, observe, judge.

Simulated time stands still while the planner thinks, so that equal seeds give equal runs to the last bit.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from aerial_evaluation.judgement import consistency, tracking
from aerial_evaluation.judgement.landing import OBSERVE_TIME, Landing, Tick, judge
from aerial_model.robot.robot import Robot
from aerial_model.values.frame import StartFrame
from aerial_model.values.plan import Plan
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import Terrain
from aerial_planner.planner import Planner
from aerial_planner.report import PlanningResult, Progress
from aerial_sim.conditions import Conditions
from aerial_sim.simulation import AS_EXPECTED, Simulation
from aerial_sim.world.placement import placed
from aerial_wbic.controller import Controller

STAND_TIME = 0.5  # before the plan is asked for [s]
PUSH_TIME = 0.02  # that the push at the apex lasts [s]
MICRO = 1e6  # microseconds in a second


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of one motion."""

    landing: Landing
    planning: PlanningResult
    terrain: Terrain  # in W
    ticks: list[Tick] = field(repr=False)  # from the first, standing included
    estimate: dict[str, dict[str, list[float]]] = field(repr=False)  # samples of its errors, see ``consistency``
    tracking: dict[str, dict[str, list[float]]] = field(repr=False)  # samples, see ``tracking``
    start_time: float  # when the controller accepted the plan [s]
    tick_time: np.ndarray  # (ticks,) wall time of the controller's steps [s]
    real_time_factor: float  # simulated over wall time, simulator and controller together
    cpu_factor: float  # simulated over processor time: what the former is where nobody else computes
    seed: int
    noise: str

    def to_json(self) -> dict[str, Any]:
        """Return what ``./aerial simulate --json`` prints."""
        return {
            **self.landing.to_json(),
            "tick_us": {
                "p50": float(np.percentile(self.tick_time, 50) * MICRO),
                "p99": float(np.percentile(self.tick_time, 99) * MICRO),
                "max": float(self.tick_time.max() * MICRO),
            },
            "real_time_factor": self.real_time_factor,
            "cpu_factor": self.cpu_factor,
            "estimate": consistency.summary([self.estimate]),
            "tracking": tracking.summary([self.tracking]),
            "plan": self.planning.report.to_json(),
            "motion": self.planning.plan.motion,
            "robot": self.planning.plan.robot,
            "noise": self.noise,
            "seed": self.seed,
        }


class Loop:
    """Simulator and controller, tick by tick, with the record of it.

    Args:
        simulation: stands in for the robot.
        controller: fresh; it sees measurements only.
    """

    def __init__(self, simulation: Simulation, controller: Controller) -> None:
        self.simulation = simulation
        self.controller = controller
        self.ticks: list[Tick] = []
        self.beliefs: list[consistency.Belief] = []  # of the same ticks
        self.tick_times: list[float] = []  # [s]
        self.wall_time = 0.0  # spent in ``advance`` [s]
        self.cpu_time = 0.0  # of this process meanwhile [s]
        self._q, self._v = simulation.state()  # the truth that the next command answers
        self._origin = StartFrame.of(simulation.robot, self._q).origin  # of the estimator's frame, in W

    def advance(self, duration: float) -> None:
        """Run for ``duration`` [s] of simulated time."""
        began, cpu_began = time.perf_counter(), time.process_time()
        for _ in range(round(duration / self.simulation.control_dt)):
            self._tick()
        self.wall_time += time.perf_counter() - began
        self.cpu_time += time.process_time() - cpu_began

    def _tick(self) -> None:
        fallbacks = self.controller.status.fallback_ticks
        began = time.perf_counter()
        command = self.controller.step(self.simulation.measure())
        self.tick_times.append(time.perf_counter() - began)
        estimate, phase = self.controller.estimate, self.controller.phase
        self.beliefs.append(consistency.Belief(phase=phase, estimate=estimate, q=self._q, v=self._v))
        self.simulation.step(command)
        fallback = self.controller.status.fallback_ticks > fallbacks
        truth = self.simulation.ground_truth()
        self._q, self._v = truth.q, truth.v
        self.ticks.append(Tick(truth=truth, fallback=fallback))

    def estimate(self) -> dict[str, dict[str, list[float]]]:
        """Return samples of the estimate's errors, phase by phase; see ``consistency.sampled``."""
        return consistency.sampled(self.beliefs, self._origin)


def run(
    robot: Robot,
    request: MotionRequest,
    *,
    seed: int = 0,
    noise: str = "nominal",
    conditions: Conditions = AS_EXPECTED,
    planner: Planner | None = None,
    progress: Progress | None = None,
) -> Outcome:
    """Return what comes of ``request`` when it is planned and executed in simulation.

    Args:
        robot: that is to move.
        request: the motion, its goal and its terrain.
        seed: of the simulation.
        noise: ``"nominal"`` or ``"off"``.
        conditions: of the world.
        planner: for this robot, to reuse one that is warm.
        progress: handed to the planner.

    Raises:
        RefusalError: if planner or controller refuse.
    """
    planner = planner or Planner(robot)
    level = Terrain(base=-request.terrain.floor)  # so that the floor of what falls away comes to lie at 0
    simulation = Simulation(robot, terrain=level, seed=seed, noise=noise, conditions=conditions)
    if level.base > 0:
        simulation.set_terrain(placed(robot, simulation.state()[0], level, request.terrain))
        simulation.reset(seed)  # onto what it is to jump off
    loop = Loop(simulation, Controller(robot))
    loop.advance(STAND_TIME)

    simulation.set_terrain(placed(robot, simulation.state()[0], simulation.terrain, request.terrain))
    planning = planner.plan(request, loop.controller.estimate, progress)
    frame = StartFrame.of(robot, simulation.state()[0])
    start_time = simulation.time
    loop.controller.accept(planning.plan)
    _execute(loop, planning.plan, conditions, seed)
    course = {"frame": frame, "start_time": start_time, "ticks": loop.ticks}
    return Outcome(
        landing=judge(robot, planning.plan, **course, ground_rise=conditions.ground_rise),
        planning=planning,
        terrain=simulation.terrain,
        ticks=loop.ticks,
        estimate=loop.estimate(),
        tracking=tracking.sampled(robot, planning.plan, **course),
        start_time=start_time,
        tick_time=np.array(loop.tick_times),
        real_time_factor=simulation.time / loop.wall_time,
        cpu_factor=simulation.time / loop.cpu_time,
        seed=seed,
        noise=noise,
    )


def _execute(loop: Loop, plan: Plan, conditions: Conditions, seed: int) -> None:
    """Run a plan that was accepted, and what comes between, until its landing has been observed."""
    apex = (plan.take_off_time + plan.landing_time) / 2
    loop.advance(apex)
    direction = np.random.default_rng([seed, 2]).uniform(-np.pi, np.pi)
    force = conditions.push / PUSH_TIME * np.array([np.cos(direction), np.sin(direction), 0.0])
    loop.simulation.disturb(force, PUSH_TIME, ground_rise=conditions.ground_rise)
    loop.advance(plan.landing_time + OBSERVE_TIME - apex)
