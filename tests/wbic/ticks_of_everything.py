"""Takes the controller through all it can do and prints which of its functions were compiled meanwhile.

Usage: ticks_of_everything.py PLAN
"""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
from numba.core.dispatcher import Dispatcher

from aerial_model.robot.robot import BASE_POSITION, Robot
from aerial_model.values.plan import Plan
from aerial_model.values.plan_file import load_plan
from aerial_sim.simulation import Simulation
from aerial_wbic.controller import Controller

WEIGHT = np.array([0.0, 0.0, -600.0])  # [N] falls on the trunk
STAND, MOTION, BEND = 100, 1000, 900  # ticks


def versions() -> dict[str, int]:
    """Return how many versions of each compiled function of ours there are."""
    modules = [module for name, module in sys.modules.items() if name.startswith("aerial_")]
    functions = {f for module in modules for f in vars(module).values() if isinstance(f, Dispatcher)}
    return {f"{f.__module__}.{f.__name__}": len(f.signatures) for f in functions}


def awkward(plan: Plan) -> Plan:
    """Return a plan whose arrays are of other kinds: read-only, column by column."""
    arrays = {
        field.name: np.asfortranarray(getattr(plan, field.name))
        for field in dataclasses.fields(plan)
        if isinstance(getattr(plan, field.name), np.ndarray)
    }
    for array in arrays.values():
        array.flags.writeable = False
    return dataclasses.replace(plan, **arrays)


def main(plan_file: Path) -> None:
    """Stand, bear more than the motors can, abort, follow a plan with and without localization, lie down, stand up, stop."""
    robot = Robot.load("mini_cheetah")
    plan = load_plan(plan_file, robot)
    simulation, controller = Simulation(robot), Controller(robot)
    before = versions()
    measurement = simulation.measure()

    def go(ticks: int, *, localized: bool = False) -> None:
        nonlocal measurement
        for _ in range(ticks):
            if localized:
                position = controller.estimate.q[BASE_POSITION].copy()
                measurement = dataclasses.replace(measurement, localization=position)
            measurement = simulation.step(controller.step(measurement))

    go(STAND)
    simulation.disturb(WEIGHT, 0.1)
    go(MOTION)
    controller.accept(plan)
    go(STAND)
    controller.abort()
    go(MOTION, localized=True)
    controller.accept(awkward(plan))
    go(STAND)
    assert controller.status.request_id == plan.request_id
    go(MOTION)
    controller.lie_down()
    go(BEND)
    controller.stand_up()
    go(BEND)
    controller.stop()
    go(STAND)
    assert controller.settled
    after = versions()
    print("compiled in a tick:", ", ".join(name for name in after if after[name] != before[name]) or "nothing")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
