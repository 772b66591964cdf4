"""One motion in closed loop, in one process and without ROS: stand, plan, execute, observe, judge.

Simulated time stands still while the planner thinks, so that equal seeds give equal runs to the last bit.
"""

from __future__ import annotations

import time

import numpy as np

from aerial_evaluation.judgement.landing import OBSERVE_TIME
from aerial_evaluation.record import Run, Tick, TickTimes, Timing
from aerial_model.robot.robot import Robot
from aerial_model.values.frame import StartFrame
from aerial_model.values.plan import Plan
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import Terrain
from aerial_planner.planner import Planner
from aerial_planner.report import Progress
from aerial_sim.conditions import Conditions
from aerial_sim.simulation import AS_EXPECTED, Simulation
from aerial_sim.world.placement import placed
from aerial_wbic.controller import Controller

STAND_TIME = 0.5  # before the plan is asked for [s]
PUSH_TIME = 0.02  # that the push at the apex lasts [s]


class Loop:
    """Simulator and controller, tick by tick, with the record of it.

    Args:
        simulation: stands in for the robot.
        controller: fresh; it sees measurements only.
        traces: keep the trace of every tick, a copy of what the next one overwrites: it slows the loop down.
    """

    def __init__(self, simulation: Simulation, controller: Controller, *, traces: bool = False) -> None:
        self.simulation = simulation
        self.controller = controller
        self.traces = traces
        self.initial = simulation.ground_truth()
        self.ticks: list[Tick] = []
        self.tick_times: list[float] = []  # wall time of the controller's steps [s]
        self.wall_time = 0.0  # spent in ``advance`` [s]
        self.cpu_time = 0.0  # of this process meanwhile [s]
        self._fallbacks = controller.status.fallback_ticks

    @property
    def timing(self) -> Timing:
        """How fast the ticks so far were computed."""
        return Timing(
            tick=TickTimes.of(self.tick_times),
            real_time_factor=self.simulation.time / self.wall_time,
            cpu_factor=self.simulation.time / self.cpu_time,
        )

    def advance(self, duration: float) -> None:
        """Run for ``duration`` [s] of simulated time."""
        began, cpu_began = time.perf_counter(), time.process_time()
        for _ in range(round(duration / self.simulation.control_dt)):
            self._tick()
        self.wall_time += time.perf_counter() - began
        self.cpu_time += time.process_time() - cpu_began

    def _tick(self) -> None:
        simulation, controller = self.simulation, self.controller
        measurement = simulation.measure()
        began = time.perf_counter()
        command = controller.step(measurement)
        self.tick_times.append(time.perf_counter() - began)
        phase, estimate, fallbacks = controller.phase, controller.estimate, controller.status.fallback_ticks
        trace = controller.trace if self.traces else None
        simulation.step(command)
        self.ticks.append(
            Tick(
                truth=simulation.ground_truth(),
                measurement=measurement,
                command=command,
                phase=phase,
                estimate=estimate,
                fallback=fallbacks > self._fallbacks,
                trace=trace,
            )
        )
        self._fallbacks = fallbacks


def run(
    robot: Robot,
    request: MotionRequest,
    *,
    seed: int = 0,
    noise: str = "nominal",
    conditions: Conditions = AS_EXPECTED,
    planner: Planner | None = None,
    progress: Progress | None = None,
    traces: bool = False,
) -> Run:
    """Return the record of ``request`` planned and executed in simulation, standing before and after it included.

    Args:
        robot: that is to move.
        request: the motion, its goal and its terrain.
        seed: of the simulation.
        noise: ``"nominal"`` or ``"off"``.
        conditions: of the world.
        planner: for this robot, to reuse one that is warm.
        progress: handed to the planner.
        traces: keep what the controller saw and wanted in every tick, see ``TickTrace``.

    Raises:
        RefusalError: if planner or controller refuse.
    """
    planner = planner or Planner(robot)
    level = Terrain(base=-request.terrain.floor)  # so that the floor of what falls away comes to lie at 0
    simulation = Simulation(robot, terrain=level, seed=seed, noise=noise, conditions=conditions)
    if level.base > 0:
        simulation.set_terrain(placed(robot, simulation.state()[0], level, request.terrain))
        simulation.reset(seed)  # onto what it is to jump off
    loop = Loop(simulation, Controller(robot), traces=traces)
    loop.advance(STAND_TIME)

    simulation.set_terrain(placed(robot, simulation.state()[0], simulation.terrain, request.terrain))
    planning = planner.plan(request, loop.controller.estimate, progress)
    start_frame = StartFrame.of(robot, simulation.state()[0])
    start_time = simulation.time
    loop.controller.accept(planning.plan)
    _execute(loop, planning.plan, conditions, seed)
    return Run(
        robot=robot,
        plan=planning.plan,
        start_frame=start_frame,
        start_time=start_time,
        ticks=loop.ticks,
        initial=loop.initial,
        request=request,
        report=planning.report,
        terrain=simulation.terrain,
        conditions=conditions,
        seed=seed,
        noise=noise,
        timing=loop.timing,
    )


def _execute(loop: Loop, plan: Plan, conditions: Conditions, seed: int) -> None:
    """Run a plan that was accepted, and what comes between, until its landing has been observed."""
    apex = (plan.take_off_time + plan.landing_time) / 2
    loop.advance(apex)
    direction = np.random.default_rng([seed, 2]).uniform(-np.pi, np.pi)
    force = conditions.push / PUSH_TIME * np.array([np.cos(direction), np.sin(direction), 0.0])
    loop.simulation.disturb(force, PUSH_TIME, ground_rise=conditions.ground_rise)
    loop.advance(plan.landing_time + OBSERVE_TIME - apex)
