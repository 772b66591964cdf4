"""The controller in closed loop with the simulator, from sensors alone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aerial_evaluation.judgement.landing import OBSERVE_TIME, judge
from aerial_evaluation.record import Run, Tick
from aerial_model.errors import InvalidPlanError, RefusalCode, RefusalError
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, BASE_POSITION, BASE_TWIST, Robot
from aerial_model.values.frame import StartFrame
from aerial_sim.simulation import Simulation
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.controller import Controller

PERIOD = 0.002  # [s]
STAND_TIME = 0.5  # [s]
HEIGHT_TOLERANCE = 5e-3  # [m]
TILT_TOLERANCE = np.radians(2.0)  # the attitude's bias included
SPEED_TOLERANCE = 0.02  # [m/s], [rad/s]
TRACKING_TOLERANCE = 0.05  # of the velocity of the centre of mass at take-off [m/s]


class Loop:
    """Simulator and controller, the record of their truths, commands and phases."""

    def __init__(self, robot, *, noise="nominal", seed=0):
        self.simulation = Simulation(robot, noise=noise, seed=seed)
        self.controller = Controller(robot)
        self.measurement = self.simulation.measure()
        self.ticks, self.commands, self.phases = [], [], []

    def run(self, duration):
        for _ in range(round(duration / PERIOD)):
            command = self.controller.step(self.measurement)
            self.measurement = self.simulation.step(command)
            self.ticks.append(Tick(truth=self.simulation.ground_truth()))
            self.commands.append(command)
            self.phases.append(self.controller.phase)

    @property
    def truth(self):
        return self.ticks[-1].truth


@pytest.fixture
def standing(robot):
    loop = Loop(robot)
    loop.run(STAND_TIME)
    return loop


@pytest.mark.parametrize("seed", range(4))
def test_it_stands_from_the_first_measurement_wherever_it_heads(robot, seed):
    loop = Loop(robot, seed=seed)
    heading = rotation.heading(loop.simulation.ground_truth().q[BASE_ORIENTATION])
    loop.run(2.0)
    home, status = robot.standing_configuration("home"), loop.controller.status
    assert loop.truth.contact.all()
    assert loop.truth.q[BASE_POSITION][2] == pytest.approx(home[2], abs=HEIGHT_TOLERANCE)
    assert rotation.tilt(loop.truth.q[BASE_ORIENTATION]) < TILT_TOLERANCE
    assert rotation.heading(loop.truth.q[BASE_ORIENTATION]) == pytest.approx(heading, abs=TILT_TOLERANCE)
    assert np.abs(loop.truth.v[BASE_TWIST]).max() < SPEED_TOLERANCE
    assert (status.phase, status.saturated_ticks, status.fallback_ticks) == (Phase.STAND, 0, 0)


@pytest.mark.parametrize("seed", range(4))
def test_it_hops_lands_and_stands_ready_for_the_next(robot, hop, seed):
    loop = Loop(robot, seed=seed)
    loop.run(STAND_TIME)
    for _ in range(2):
        frame = StartFrame.of(robot, loop.truth.q)
        start = loop.measurement.time
        loop.controller.accept(hop)
        loop.run(hop.landing_time + OBSERVE_TIME)
        verdict = judge(Run(robot=robot, plan=hop, start_frame=frame, start_time=start, ticks=loop.ticks))
        assert verdict.failed == ()
        assert loop.controller.phase is Phase.STAND
    assert list(dict.fromkeys(loop.phases)) == [Phase.STAND, Phase.TAKE_OFF, Phase.FLIGHT, Phase.LANDING]


def test_it_follows_the_plan_to_take_off(standing, hop):
    standing.controller.accept(hop)
    standing.run(hop.take_off_time - PERIOD)
    status = standing.controller.status
    assert status.phase is Phase.TAKE_OFF
    assert status.request_id == "hop"
    assert status.time_in_plan == pytest.approx(hop.take_off_time - 2 * PERIOD)
    assert np.abs(status.com_velocity_error).max() < TRACKING_TOLERANCE


def test_phases_follow_the_plans_times(standing, hop):
    standing.controller.accept(hop)
    before = len(standing.phases)
    standing.run(hop.landing_time + 0.01)
    phases = standing.phases[before:]
    assert phases.count(Phase.TAKE_OFF) == pytest.approx(hop.take_off_time / PERIOD, abs=1)
    assert phases.count(Phase.FLIGHT) == pytest.approx((hop.landing_time - hop.take_off_time) / PERIOD, abs=1)


@pytest.mark.parametrize("rounding", [-1e-12, 1e-12])
def test_a_phase_begins_with_its_tick_however_times_are_rounded(standing, hop, rounding):
    time = hop.time + rounding * (hop.time == hop.take_off_time)
    plan = dataclasses.replace(hop, time=time, take_off_time=hop.take_off_time + rounding)
    standing.controller.accept(plan)
    begin = len(standing.phases)
    standing.run(plan.take_off_time + PERIOD)
    assert standing.phases[begin:].count(Phase.TAKE_OFF) == round(plan.take_off_time / PERIOD)


def test_equal_seeds_give_equal_commands_to_the_last_bit(robot, hop):
    def torques():
        loop = Loop(robot, seed=3)
        loop.run(STAND_TIME)
        loop.controller.accept(hop)
        loop.run(1.0)
        return np.array([command.torque for command in loop.commands])

    np.testing.assert_array_equal(torques(), torques())


def test_a_reset_controller_is_a_new_one(robot, hop):
    used, new = Loop(robot, seed=3), Loop(robot, seed=3)
    used.run(STAND_TIME)
    used.controller.accept(hop)
    used.run(0.1)
    used.simulation.reset(3)
    used.controller.reset()
    used.measurement = used.simulation.measure()
    used.commands.clear()
    for loop in (used, new):
        loop.run(0.1)
    for before, after in zip(used.commands, new.commands, strict=True):
        np.testing.assert_allclose(before.torque, after.torque, atol=1e-3)  # the solver's warm start differs


# --- what is refused -------------------------------------------------------------------------------------------------


def refused(call):
    with pytest.raises(RefusalError) as caught:
        call()
    return caught.value


def test_no_plan_is_taken_before_a_measurement(robot, hop):
    refusal = refused(lambda: Controller(robot).accept(hop))
    assert refusal.code is RefusalCode.NOT_STANDING


def test_a_second_plan_is_refused_while_one_runs(standing, hop):
    standing.controller.accept(hop)
    assert refused(lambda: standing.controller.accept(hop)).code is RefusalCode.BUSY


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda q: q + 0.3 * (np.arange(len(q)) == 9), "knee"),
        (lambda q: np.concatenate([q[:3], rotation.exp(np.array([0.0, 0.2, 0.0])), q[7:]]), "turned"),
    ],
)
def test_a_plan_that_starts_elsewhere_is_refused(standing, hop, change, word):
    elsewhere = dataclasses.replace(hop, q=np.array([change(q) for q in hop.q]))
    refusal = refused(lambda: standing.controller.accept(elsewhere))
    assert refusal.code is RefusalCode.START_MISMATCH
    assert word in refusal.reason


def test_a_plan_is_refused_while_the_robot_moves(robot, hop):
    loop = Loop(robot)
    loop.run(STAND_TIME)
    loop.controller.estimate.v[0] = 0.5
    assert refused(lambda: loop.controller.accept(hop)).code is RefusalCode.NOT_STANDING


def test_a_plan_that_is_not_finite_leaves_the_robot_standing(standing, hop):
    v = hop.v.copy()
    v[3, 4] = np.nan
    with pytest.raises(InvalidPlanError, match="v: not finite"):
        standing.controller.accept(dataclasses.replace(hop, v=v))
    standing.run(0.1)
    assert standing.controller.phase is Phase.STAND


def test_contacts_of_a_plan_are_truth_values(standing, hop):
    """Numbers would be taken for the numbers of points."""
    with pytest.raises(InvalidPlanError, match="contact: expected truth values, found int8"):
        standing.controller.accept(dataclasses.replace(hop, contact=hop.contact.astype(np.int8)))


@pytest.mark.parametrize("value", [1e200, np.inf, np.nan])
@pytest.mark.parametrize("name", ["joint_position", "joint_velocity", "angular_velocity", "linear_acceleration"])
@pytest.mark.parametrize("robot_name", ["mini_cheetah", "mit_humanoid"])
def test_no_measurement_ends_a_tick(robot_name, name, value):
    robot = Robot.load(robot_name)
    simulation, controller = Simulation(robot), Controller(robot)
    measurement = simulation.measure()
    controller.step(measurement)
    broken = dataclasses.replace(measurement, **{name: np.full_like(getattr(measurement, name), value)})
    command = controller.step(dataclasses.replace(broken, time=PERIOD, sequence=1))
    assert np.isfinite(command.torque).all()
    assert np.isfinite(command.damping).all()


def test_a_plan_for_another_robot_is_refused(standing, hop):
    with pytest.raises(InvalidPlanError, match="another"):
        standing.controller.accept(dataclasses.replace(hop, model_hash="another"))


# --- what else it is told --------------------------------------------------------------------------------------------


def test_a_motion_is_aborted_on_the_ground(standing, hop):
    standing.controller.accept(hop)
    standing.ticks.clear()
    standing.run(0.2)
    standing.controller.abort()
    standing.run(1.5)
    assert standing.controller.phase is Phase.STAND
    assert all(tick.truth.contact.all() for tick in standing.ticks)
    standing.controller.accept(hop)


def test_it_is_too_late_to_abort_in_the_air(standing, hop):
    standing.controller.accept(hop)
    standing.run(hop.take_off_time + 0.05)
    assert refused(standing.controller.abort).code is RefusalCode.BUSY


def test_there_is_nothing_to_abort_while_it_stands(standing):
    assert "STAND" in refused(standing.controller.abort).reason


def test_it_lies_down_and_stands_up_again(standing, robot):
    standing.controller.lie_down()
    assert not standing.controller.settled
    standing.run(2.5)
    assert standing.controller.settled
    assert standing.controller.phase is Phase.LIE
    assert standing.truth.q[2] < 0.5 * robot.standing_configuration()[2]
    assert not standing.commands[-1].torque.any()
    standing.controller.stand_up()
    standing.run(3.0)
    assert standing.controller.phase is Phase.STAND
    assert standing.truth.q[2] == pytest.approx(robot.standing_configuration()[2], abs=HEIGHT_TOLERANCE)


def test_it_lies_down_only_from_standing(standing, hop):
    standing.controller.accept(hop)
    assert refused(standing.controller.lie_down).code is RefusalCode.NOT_STANDING


def test_it_stands_up_only_from_lying(standing):
    assert refused(standing.controller.stand_up).code is RefusalCode.INVALID_REQUEST


def test_an_emergency_stop_latches(standing, hop):
    standing.controller.stop()
    standing.run(1.0)
    assert standing.controller.phase is Phase.STOPPED
    assert not any(command.torque.any() for command in standing.commands[-100:])
    assert refused(lambda: standing.controller.accept(hop)).code is RefusalCode.STOPPED
    assert refused(standing.controller.stand_up).code is RefusalCode.STOPPED
    standing.controller.reset()
    standing.run(1.5)
    assert standing.controller.phase is Phase.STAND


def test_a_robot_that_is_knocked_over_lets_go(standing):
    q, v = standing.simulation.state()
    q[BASE_POSITION] += [0.0, 0.0, 0.3]
    q[BASE_ORIENTATION] = rotation.exp(np.array([2.5, 0.0, 0.0]))
    standing.simulation.set_state(q, v)
    standing.run(1.0)
    assert standing.controller.phase is Phase.LIE
    assert not standing.commands[-1].torque.any()
    assert refused(standing.controller.stand_up).code is RefusalCode.FELL
