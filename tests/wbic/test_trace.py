"""The trace of a tick: what it saw, wanted and commanded, as the tick itself had it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from aerial_model.robot.robot import JOINT_VELOCITY
from aerial_sim.simulation import Simulation
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.controller import Controller
from aerial_wbic.stopwatch import Part, Stopwatch
from aerial_wbic.target import PostureTarget, WholeBodyTarget

PERIOD = 0.002  # [s]
EQUATION_TOLERANCE = 1e-6  # [N·m]


class Loop:
    def __init__(self, robot, clock=None):
        self.simulation, self.controller = Simulation(robot), Controller(robot, clock)
        self.measurement = self.simulation.measure()

    def run(self, ticks):
        for _ in range(ticks):
            self.answered = self.measurement
            self.command = self.controller.step(self.measurement)
            self.measurement = self.simulation.step(self.command)


@pytest.fixture
def loop(robot):
    loop = Loop(robot)
    loop.run(200)
    return loop


def test_before_a_tick_there_is_no_trace(robot):
    with pytest.raises(RuntimeError, match="first measurement"):
        _ = Controller(robot).trace


def test_a_trace_is_of_the_measurement_that_was_answered(loop):
    trace = loop.controller.trace
    assert (trace.time, trace.sequence) == (loop.answered.time, loop.answered.sequence)
    assert trace.estimate is loop.controller.estimate
    assert trace.command is loop.command
    assert (trace.phase, trace.behaviour, trace.request_id, trace.time_in_plan) == (Phase.STAND, "stand", "", 0.0)
    assert trace.contact.all()
    assert isinstance(trace.target, WholeBodyTarget)
    assert (trace.saturated, trace.fallback) == (False, False)
    assert trace.durations == {}


def test_a_traces_torques_and_forces_obey_the_equations_of_motion(loop, robot):
    """At rest, with q̈ near zero, the joint torques are those of gravity less what the ground gives."""
    trace = loop.controller.trace
    weight = robot.mass * 9.81
    assert trace.force[:, 2].sum() == pytest.approx(weight, rel=0.02)
    assert np.abs(trace.vdot_cmd).max() < 1.0
    friction = trace.command.torque - trace.joint_torque  # what the joint command adds
    assert np.abs(friction).max() < np.abs(trace.joint_torque).max()


def test_a_trace_holds_while_ticks_go_on(loop, hop):
    loop.controller.accept(hop)
    loop.run(50)
    trace = loop.controller.trace
    before = [np.array(each) for each in (*trace.target.body[:6], trace.force, trace.joint_torque, trace.vdot_cmd)]
    loop.run(50)
    after = [trace.target.body[k] for k in range(6)] + [trace.force, trace.joint_torque, trace.vdot_cmd]
    for one, other in zip(before, after, strict=True):
        np.testing.assert_array_equal(one, other)
    assert not np.array_equal(loop.controller.trace.target.body.com, trace.target.body.com)


def test_a_plan_is_traced_from_its_first_tick_on(loop, hop):
    loop.controller.accept(hop)
    assert loop.controller.trace.behaviour == "stand"  # still that of the last tick
    loop.run(2)
    trace = loop.controller.trace
    assert (trace.behaviour, trace.phase, trace.request_id) == ("follow plan", Phase.TAKE_OFF, hop.request_id)
    assert trace.time_in_plan == pytest.approx(PERIOD)
    np.testing.assert_allclose(trace.target.joint_position, hop.sample(PERIOD).q[7:], atol=1e-4)
    assert trace.v_ref[JOINT_VELOCITY].shape == hop.start_joint_position.shape


def test_who_lies_or_folds_has_no_forces(loop):
    loop.controller.lie_down()
    loop.run(900)
    lying = loop.controller.trace
    assert (lying.behaviour, lying.target, lying.vdot_cmd, lying.force) == ("lie", None, None, None)
    loop.controller.stand_up()
    loop.run(1)
    folding = loop.controller.trace
    assert folding.behaviour == "fold"
    assert isinstance(folding.target, PostureTarget)
    np.testing.assert_array_equal(folding.command.position, folding.target.joint_position)


def test_with_a_clock_a_trace_tells_how_long_every_part_took(robot):
    ticks = itertools.count()
    loop = Loop(robot, clock=lambda: float(next(ticks)))
    loop.run(3)
    durations = loop.controller.trace.durations
    assert set(durations) == set(Part)
    assert durations[Part.ESTIMATE] == 2.0  # before and after the kinematics
    assert all(durations[part] == 1.0 for part in Part if part is not Part.ESTIMATE)


def test_a_stopwatch_gives_each_part_the_time_since_the_last_lap():
    times = iter([10.0, 11.0, 13.0, 17.0])
    stopwatch = Stopwatch(lambda: next(times))
    stopwatch.start()
    for part in (Part.QP, Part.TORQUE, Part.QP):
        stopwatch.lap(part)
    assert (stopwatch.durations[Part.QP], stopwatch.durations[Part.TORQUE]) == (1.0 + 4.0, 2.0)
    assert sum(stopwatch.durations.values()) == 7.0
