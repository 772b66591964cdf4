"""The controller in closed loop with the simulator, from sensors alone."""

from __future__ import annotations

import numpy as np
import pytest

from aerial_model import rotation
from aerial_model.robot import BASE_ORIENTATION, BASE_POSITION, BASE_TWIST, Robot
from aerial_sim.simulation import Simulation
from aerial_wbic.controller import Controller
from aerial_wbic.phase import Phase

STANDING_TICKS = 1000  # 2 s
HEIGHT_TOLERANCE = 5e-3  # [m]
TILT_TOLERANCE = np.radians(2.0)  # the attitude's bias included
SPEED_TOLERANCE = 0.02  # [m/s], [rad/s]


@pytest.mark.parametrize("seed", range(4))
def test_it_stands_from_the_first_measurement_wherever_it_heads(robot: Robot, seed: int) -> None:
    simulation, controller = Simulation(robot, noise="nominal", seed=seed), Controller(robot)
    heading = rotation.heading(simulation.ground_truth().q[BASE_ORIENTATION])
    measurement = simulation.measure()
    for _ in range(STANDING_TICKS):
        measurement = simulation.step(controller.step(measurement))
    truth = simulation.ground_truth()
    home = robot.standing_configuration("home")
    assert truth.contact.all()
    assert truth.q[BASE_POSITION][2] == pytest.approx(home[2], abs=HEIGHT_TOLERANCE)
    assert rotation.tilt(truth.q[BASE_ORIENTATION]) < TILT_TOLERANCE
    assert rotation.heading(truth.q[BASE_ORIENTATION]) == pytest.approx(heading, abs=TILT_TOLERANCE)
    assert np.abs(truth.v[BASE_TWIST]).max() < SPEED_TOLERANCE
    assert controller.phase is Phase.STAND
    assert controller.status.saturated_ticks == 0
    assert controller.status.fallback_ticks == 0
