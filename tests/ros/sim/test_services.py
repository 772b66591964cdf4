"""What the simulator is told by services, but for its terrain."""

import numpy as np
import pytest
from std_srvs.srv import SetBool

from aerial_msgs.srv import Disturb, Reset, Step
from aerial_sim.ros.messages import ground_truth_from_message


def test_pause_and_step(start, until):
    sim, peer = start()
    until(lambda: len(peer.states) > 50)
    assert peer.call(SetBool, "sim/pause", SetBool.Request(data=True), until).success
    reached = peer.states[-1].sequence
    answer = peer.call(Step, "sim/step", Step.Request(count=20), until)
    assert answer.success
    until(lambda: peer.states[-1].sequence == reached + 20)
    assert answer.stamp == peer.states[-1].stamp
    assert peer.call(SetBool, "sim/pause", SetBool.Request(data=False), until).success
    until(lambda: peer.states[-1].sequence > reached + 100)
    assert sim.diagnose()[1] == "running"


def test_a_step_needs_a_pause(start, until):
    _, peer = start()
    until(lambda: len(peer.states) > 50)
    answer = peer.call(Step, "sim/step", Step.Request(count=20), until)
    assert not answer.success
    assert "not paused" in answer.message


def test_a_push_moves_the_robot_and_nonsense_does_not(start, until):
    _, peer = start()
    until(lambda: len(peer.truths) > 250)
    request = Disturb.Request(force=[20.0, 0.0, 0.0], duration=0.1)
    assert peer.call(Disturb, "sim/disturb", request, until).success
    begin = len(peer.truths)
    until(lambda: len(peer.truths) > begin + 40)
    assert max(truth.odometry.twist.twist.linear.x for truth in peer.truths[begin:]) > 0.01
    answer = peer.call(Disturb, "sim/disturb", Disturb.Request(force=[np.nan, 0.0, 0.0], duration=0.1), until)
    assert not answer.success


def test_added_mass_weighs_until_it_is_taken_off(start, until, robot):
    _, peer = start()
    until(lambda: len(peer.truths) > 250)
    for added in (2.0, 0.0):
        request = Disturb.Request(has_added_mass=True, added_mass=added)
        assert peer.call(Disturb, "sim/disturb", request, until).success
        begin = len(peer.truths)
        until(lambda begin=begin: len(peer.truths) > begin + 400)
        weight = ground_truth_from_message(peer.truths[-1]).force[:, 2].sum()
        assert weight == pytest.approx(9.81 * (robot.mass + added), rel=0.01)


def test_on_ice_a_push_makes_the_robot_slide(start, until):
    _, peer = start()
    until(lambda: len(peer.truths) > 250)
    slid = []
    for coefficient in (0.7, 0.02):
        request = Disturb.Request(
            has_friction_coefficient=True, friction_coefficient=coefficient, force=[15.0, 0.0, 0.0], duration=0.1
        )
        begin = len(peer.truths)
        x = peer.truths[-1].odometry.pose.pose.position.x
        assert peer.call(Disturb, "sim/disturb", request, until).success
        until(lambda begin=begin: len(peer.truths) > begin + 200)
        slid.append(peer.truths[-1].odometry.pose.pose.position.x - x)
    assert slid[0] < 0.005 < slid[1]


@pytest.mark.parametrize(
    ("nonsense", "reason"),
    [
        ({"has_friction_coefficient": True, "friction_coefficient": -0.1}, "negative"),
        ({"duration": -1.0}, "negative"),
        ({"has_added_mass": True, "added_mass": -10.0}, "leave nothing of the trunk"),
        ({"has_added_mass": True, "added_mass": float("inf")}, "finite"),
    ],
)
def test_a_disturbance_that_makes_no_sense_is_refused_with_the_reason(start, until, nonsense, reason):
    _, peer = start()
    until(lambda: len(peer.states) > 50)
    answer = peer.call(Disturb, "sim/disturb", Disturb.Request(**nonsense), until)
    assert not answer.success
    assert reason in answer.message


def test_a_reset_ends_no_pause(start, until):
    sim, peer = start(noise="nominal", seed=5)
    until(lambda: len(peer.states) > 100)
    assert peer.call(SetBool, "sim/pause", SetBool.Request(data=True), until).success
    assert peer.call(Reset, "sim/reset", Reset.Request(seed=5), until).success
    until(lambda: peer.states[-1].sequence == 0 and sim._exchange.started)
    assert peer.call(Step, "sim/step", Step.Request(count=20), until).success
    until(lambda: peer.states[-1].sequence == 20)
    assert sim.diagnose()[1] == "paused"
