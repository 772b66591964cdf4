import dataclasses
import time

import numpy as np
import pytest
from rclpy.parameter import Parameter

from aerial_model.timing import CONTROL_PERIOD
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import Terrain
from aerial_msgs.msg import MotionResult
from aerial_msgs.srv import Reset
from aerial_ros.messages import selection_to_message
from aerial_sim.ros.messages import ground_truth_from_message
from aerial_sim.ros.sim_node import SimNode

LATENESS = 0.6  # share of real time that a busy machine may lose in a test
PLATFORM = MotionRequest(
    motion="jump", displacement=[0.5, 0.0, 0.16], terrain=Terrain.platform(0.16, 0.3, 0.0), request_id="one"
)


def test_lock_step_advances_by_one_period_a_command(start, until):
    _, peer = start()
    until(lambda: len(peer.states) > 200)
    sequences = [state.sequence for state in peer.states]
    assert sequences == list(range(sequences[0], sequences[0] + len(sequences)))


def test_lock_step_waits_without_a_command_and_repeats_its_state(start, until):
    sim, peer = start()
    until(lambda: len(peer.states) > 10)
    peer.answers = False
    before = peer.states[-1].sequence + 1
    until(lambda: len(peer.states) >= 3 and peer.states[-1].sequence == peer.states[-2].sequence)
    assert peer.states[-1].sequence <= before
    peer.answers = True
    until(lambda: peer.states[-1].sequence > before + 10)
    assert sim.diagnose()[2]["missed_ticks"] == 0


def test_lock_step_is_repeatable_to_the_last_bit(start, until):
    _, peer = start(noise="nominal", seed=5)
    until(lambda: len(peer.states) > 100)
    first = {state.sequence: state for state in peer.states}
    peer.states.clear()
    assert peer.call(Reset, "sim/reset", Reset.Request(seed=5), until).success
    until(lambda: len(peer.states) > 100 and peer.states[-1].sequence >= 90)
    again = {state.sequence: state for state in peer.states if state.sequence <= 90}
    peer.answers = False
    assert all(state == first[sequence] for sequence, state in again.items() if sequence in first)


def test_real_time_keeps_the_pace(start, until):
    _, peer = start(real_time=True)
    until(lambda: peer.states and peer.states[-1].sequence > 0)
    begin, first = time.monotonic(), peer.states[-1].sequence
    until(lambda: peer.states[-1].sequence > first + 400)
    elapsed, simulated = time.monotonic() - begin, CONTROL_PERIOD * (peer.states[-1].sequence - first)
    assert simulated == pytest.approx(elapsed, rel=LATENESS)


def test_real_time_counts_ticks_without_a_command_as_missed(start, until):
    sim, peer = start(real_time=True)
    until(lambda: peer.states and peer.states[-1].sequence > 50)
    before = sim.diagnose()[2]["missed_ticks"]
    peer.answers = False
    last = peer.states[-1].sequence
    until(lambda: peer.states[-1].sequence > last + 50)
    assert sim.diagnose()[2]["missed_ticks"] - before >= 45


def test_a_command_that_is_no_number_is_rejected_and_the_robot_stands(start, until, robot):
    sim, peer = start(real_time=True)
    until(lambda: peer.states and peer.states[-1].sequence > 250)
    broken = dataclasses.replace(peer.command, torque=np.full(robot.n_joints, np.nan))

    def is_rejected():
        """Send it again and again: in real time the next command may take its place before it is read."""
        peer.send(broken, peer.states[-1])
        return sim.diagnose()[2]["rejected_commands"] > 0

    until(is_rejected)
    last = peer.states[-1].sequence
    until(lambda: peer.states[-1].sequence > last + 100)
    assert peer.truths[-1].contact == [True] * 4


def test_people_and_tools_get_a_tenth_of_a_second_in_ten_messages(start, until, robot):
    _, peer = start()
    until(lambda: len(peer.states) > 150)
    stamps = [message.clock.sec + message.clock.nanosec * 1e-9 for message in peer.heard["/clock"]]
    np.testing.assert_allclose(np.diff(stamps), 0.01, atol=1e-9)
    assert len(peer.heard["joint_states"]) == pytest.approx(len(stamps), abs=2)
    assert len(peer.heard["imu"]) == pytest.approx(len(stamps), abs=2)
    assert peer.heard["joint_states"][0].name == list(robot.joint_names)
    assert "<robot" in peer.heard["description"][0].data


def test_ground_truth_survives_the_wire(start, until, robot):
    _, peer = start()
    until(lambda: len(peer.truths) > 250)
    truth = ground_truth_from_message(peer.truths[-1])
    assert truth.q.shape == (robot.model.nq,)
    assert truth.contact.all()
    np.testing.assert_allclose(truth.force.sum(axis=0), [0, 0, robot.mass * 9.81], atol=2.0)


def test_ground_truth_can_be_kept_secret(start, until):
    _, peer = start(ground_truth=False)
    until(lambda: len(peer.states) > 50)
    assert peer.truths == []


def test_a_selection_holds_lock_step_until_its_plan_and_leaves_the_world_alone(start, until):
    sim, peer = start()
    until(lambda: len(peer.states) > 50)
    peer.selections.publish(selection_to_message(PLATFORM))
    until(lambda: sim._exchange.awaited == "one")
    held = peer.states[-1].sequence
    assert sim._exchange.simulation.terrain.boxes == ()
    peer.results.publish(MotionResult(request_id="one", outcome=MotionResult.PLANNED))
    peer.results.publish(MotionResult(request_id="one", outcome=MotionResult.STARTED))
    until(lambda: peer.states[-1].sequence > held + 50)


def test_a_refusal_lets_time_go_on(start, until):
    sim, peer = start()
    until(lambda: len(peer.states) > 50)
    peer.selections.publish(selection_to_message(PLATFORM))
    until(lambda: sim._exchange.awaited == "one")
    held = peer.states[-1].sequence
    peer.results.publish(MotionResult(request_id="one", outcome=MotionResult.REFUSED))
    until(lambda: peer.states[-1].sequence > held + 50)
    assert sim._exchange.awaited is None


def test_a_robot_that_does_not_exist_leaves_the_node_unconfigured(executor):
    sim = SimNode(parameter_overrides=[Parameter("robot", value="no_such_robot")])
    executor.add_node(sim)
    assert not sim.start()
