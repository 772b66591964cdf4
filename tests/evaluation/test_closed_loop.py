from types import SimpleNamespace

import numpy as np
import pytest

from aerial_evaluation.closed_loop import Loop
from aerial_model.robot.robot import JOINT_POSITION, Robot
from aerial_model.values.command import Command
from aerial_model.values.estimate import Estimate
from aerial_sim.simulation import Simulation
from aerial_wbic.behaviours.phase import Phase


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


class Holder:
    """A controller that holds the home pose and falls back in its third tick."""

    def __init__(self, robot):
        self.status = SimpleNamespace(fallback_ticks=0)
        self._zero = np.zeros(robot.n_joints)
        self._home = robot.poses["home"]
        self._ticks = 0
        self.phase = Phase.STAND

    def step(self, measurement):
        self._ticks += 1
        self.estimate = Estimate(
            time=measurement.time,
            q=np.concatenate([np.zeros(3), measurement.orientation, measurement.joint_position]),
            v=np.zeros(6 + len(self._home)),
            position_variance=1e-6,
            velocity_variance=1e-4,
        )
        self.status.fallback_ticks += self._ticks == 3
        gains = {"stiffness": self._zero + 100.0, "damping": self._zero + 2.0}
        return Command(torque=self._zero, position=self._home, velocity=self._zero, **gains)


@pytest.fixture
def loop(robot):
    loop = Loop(Simulation(robot, noise="off"), Holder(robot))
    loop.advance(0.1)
    return loop


def test_a_loop_records_every_tick_and_its_duration(loop):
    assert [tick.truth.time for tick in loop.ticks] == pytest.approx(0.002 * np.arange(1, 51))
    assert len(loop.tick_times) == 50
    assert loop.cpu_time > 0
    assert loop.wall_time >= sum(loop.tick_times)


def test_a_tick_is_the_measurement_its_answer_and_the_state_they_lead_to(loop):
    for before, tick in zip([loop.initial, *(tick.truth for tick in loop.ticks)], loop.ticks, strict=False):
        assert tick.measurement.time == tick.estimate.time == pytest.approx(before.time)
        np.testing.assert_allclose(tick.measurement.joint_position, before.q[JOINT_POSITION], atol=1e-12)  # no noise


def test_recorded_commands_repeat_the_recorded_motion(robot, loop):
    again = Simulation(robot, noise="off")
    for tick in loop.ticks:
        again.step(tick.command)
        np.testing.assert_array_equal(again.ground_truth().q, tick.truth.q)


def test_a_loop_notes_the_ticks_in_which_the_controller_fell_back(loop):
    assert [k for k, tick in enumerate(loop.ticks) if tick.fallback] == [2]
