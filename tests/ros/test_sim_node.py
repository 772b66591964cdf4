import dataclasses
import time

import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool

from aerial_model.robot.robot import Robot
from aerial_model.values.command import Command
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import Terrain
from aerial_msgs.msg import GroundTruth, JointCommand, MotionResult, MotionSelection, RobotState
from aerial_msgs.srv import Disturb, Reset, Step
from aerial_ros import qos
from aerial_ros.messages import selection_to_message
from aerial_ros.wire import CommandWire
from aerial_sim.ros.messages import ground_truth_from_message
from aerial_sim.ros.sim_node import SimNode

LATENESS = 0.6  # share of real time that a busy machine may lose in a test
PLATFORM = MotionRequest(
    motion="jump", displacement=[0.5, 0.0, 0.16], terrain=Terrain.platform(0.16, 0.3, 0.0), request_id="one"
)


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


class Peer(Node):
    """Answers states by holding the home pose, keeps what it hears, says what it is told to."""

    def __init__(self, robot, real_time):
        super().__init__("peer")
        zero = np.zeros(robot.n_joints)
        self._wire = CommandWire(robot)
        self.command = Command(
            torque=zero, position=robot.poses["home"], velocity=zero, stiffness=zero + 100.0, damping=zero + 2.0
        )
        self.answers = True
        self.states, self.truths, self.heard = [], [], {}
        control = qos.control(real_time)
        self._commands = self.create_publisher(JointCommand, "joint_command", control)
        self.selections = self.create_publisher(MotionSelection, "motion_selection", qos.EVENT)
        self.results = self.create_publisher(MotionResult, "motion_result", qos.EVENT)
        self.create_subscription(RobotState, "state", self._on_state, control)
        self.create_subscription(GroundTruth, "ground_truth", self.truths.append, qos.RECORD)
        for name, kind in {"joint_states": JointState, "imu": Imu, "/clock": Clock}.items():
            self.create_subscription(kind, name, lambda message, name=name: self._hear(name, message), qos.TELEMETRY)
        self.create_subscription(String, "robot_description", lambda m: self._hear("description", m), qos.LATCHED)

    def _on_state(self, state):
        self.states.append(state)
        if self.answers:
            self.send(self.command, state)

    def send(self, command, state):
        command = dataclasses.replace(command, state_sequence=state.sequence)
        self._commands.publish(self._wire.write(command))

    def _hear(self, name, message):
        self.heard.setdefault(name, []).append(message)

    def call(self, kind, name, request, until):
        client = self.create_client(kind, name)
        until(client.service_is_ready)
        future = client.call_async(request)
        until(future.done)
        return future.result()


@pytest.fixture
def start(executor, robot, until):
    """Start simulator and peer: ``start(real_time=..., **parameters)``."""
    started = []

    def start(real_time=False, **parameters):
        parameters = {"real_time": real_time, "noise": "off", **parameters}
        sim = SimNode(parameter_overrides=[Parameter(name, value=value) for name, value in parameters.items()])
        peer = Peer(robot, real_time)
        executor.add_node(sim)
        executor.add_node(peer)
        until(lambda: peer.count_publishers("state") or sim.count_subscribers("state"))
        assert sim.start()
        started.append(sim)
        return sim, peer

    yield start
    for sim in started:
        sim.trigger_deactivate()
        sim.trigger_cleanup()


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
    elapsed, simulated = time.monotonic() - begin, 0.002 * (peer.states[-1].sequence - first)
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


def test_a_selection_places_its_terrain_and_holds_lock_step_until_its_plan(start, until):
    sim, peer = start()
    until(lambda: len(peer.states) > 50)
    peer.selections.publish(selection_to_message(PLATFORM))
    until(lambda: sim._session.awaited == "one")
    held = peer.states[-1].sequence
    assert sim._session.simulation.terrain.boxes[0].top == pytest.approx(0.16, abs=1e-3)
    peer.results.publish(MotionResult(request_id="one", outcome=MotionResult.PLANNED))
    peer.results.publish(MotionResult(request_id="one", outcome=MotionResult.STARTED))
    until(lambda: peer.states[-1].sequence > held + 50)


def test_a_refusal_lets_time_go_on(start, until):
    sim, peer = start()
    until(lambda: len(peer.states) > 50)
    peer.selections.publish(selection_to_message(PLATFORM))
    until(lambda: sim._session.awaited == "one")
    held = peer.states[-1].sequence
    peer.results.publish(MotionResult(request_id="one", outcome=MotionResult.REFUSED))
    until(lambda: peer.states[-1].sequence > held + 50)
    assert sim._session.awaited is None


def test_time_does_not_wait_for_a_selection_that_was_refused_before_it_came(start, until):
    sim, peer = start()
    until(lambda: len(peer.states) > 50)
    peer.results.publish(MotionResult(request_id="one", outcome=MotionResult.REFUSED))
    until(lambda: sim._refused == "one")
    peer.selections.publish(selection_to_message(PLATFORM))
    until(lambda: sim._session.simulation.terrain.boxes)
    assert sim._session.awaited is None


def test_terrain_does_not_change_under_a_running_motion(start, until):
    sim, peer = start()
    until(lambda: len(peer.states) > 50)
    peer.results.publish(MotionResult(request_id="zero", outcome=MotionResult.STARTED))
    until(lambda: sim._moving is not None)
    peer.selections.publish(selection_to_message(PLATFORM))
    seen = peer.states[-1].sequence
    until(lambda: peer.states[-1].sequence > seen + 100)
    assert sim._session.simulation.terrain.boxes == ()


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
    until(lambda: peer.states[-1].sequence == 0 and sim._session.started)
    assert peer.call(Step, "sim/step", Step.Request(count=20), until).success
    until(lambda: peer.states[-1].sequence == 20)
    assert sim.diagnose()[1] == "paused"


def test_a_robot_that_does_not_exist_leaves_the_node_unconfigured(executor):
    sim = SimNode(parameter_overrides=[Parameter("robot", value="no_such_robot")])
    executor.add_node(sim)
    assert not sim.start()
