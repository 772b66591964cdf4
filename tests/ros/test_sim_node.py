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

from aerial_model.errors import ConfigurationError
from aerial_model.robot.robot import Robot
from aerial_model.timing import CONTROL_PERIOD
from aerial_model.values.command import Command
from aerial_model.values.frame import StartFrame
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import Box, Terrain
from aerial_msgs.msg import GroundTruth, JointCommand, MotionResult, MotionSelection, RobotState, TerrainBox
from aerial_msgs.srv import Disturb, Reset, SetTerrain, Step
from aerial_ros import qos
from aerial_ros.messages import selection_to_message, terrain_from_message, terrain_to_message
from aerial_ros.wire import CommandWire
from aerial_sim.ros.messages import ground_truth_from_message
from aerial_sim.ros.sim_node import SimNode

LATENESS = 0.6  # share of real time that a busy machine may lose in a test
PLATFORM = MotionRequest(
    motion="jump", displacement=[0.5, 0.0, 0.16], terrain=Terrain.platform(0.16, 0.3, 0.0), request_id="one"
)
REFUSAL_TIME = 5e-3  # [s] of which a busy machine takes most


def ahead(terrain):
    """The request that places a terrain ahead of the robot."""
    return SetTerrain.Request(frame=SetTerrain.Request.START_HEADING, boxes=terrain_to_message(terrain))


def with_box(centre=(2.0, 0.0, 0.0), size=(1.0, 1.0, 1.0), yaw=0.0):
    """The request for a world with one box."""
    return SetTerrain.Request(boxes=[TerrainBox(centre=list(centre), size=list(size), yaw=yaw)])


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


def test_terrain_is_placed_ahead_of_the_robot_and_put_back(start, until, robot):
    sim, peer = start()
    until(lambda: len(peer.truths) > 250)
    answer = peer.call(SetTerrain, "sim/set_terrain", ahead(PLATFORM.terrain), until)
    assert (answer.success, answer.message, answer.previous) == (True, "", [])
    simulation = sim._exchange.simulation
    frame = StartFrame.of(robot, simulation.state()[0])
    points = frame.origin + np.array([[0.0, 0, 0], [0.28, 0, 0], [0.32, 0, 0], [0.6, 0.2, 0]]) @ frame.R_WS.T
    np.testing.assert_allclose(simulation.terrain.height(points), [0, 0, 0.16, 0.16], atol=1e-3)
    seen = len(peer.truths)
    until(lambda: len(peer.truths) > seen + 100)
    assert peer.truths[-1].contact == [True] * 4
    back = SetTerrain.Request(boxes=answer.previous, floor=answer.previous_floor)
    answer = peer.call(SetTerrain, "sim/set_terrain", back, until)
    assert answer.success
    assert len(answer.previous) == 1
    assert simulation.terrain == Terrain()


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (ahead(Terrain.platform(0.16, 0.0, 0.0)), "rise by 0.160 m"),
        (ahead(Terrain(boxes=(Box(centre=[0.0, 0.0, 0.2], size=[0.1, 0.1, 0.4]),))), "run through the robot (base)"),
        (SetTerrain.Request(floor=-0.5), "sink by 0.500 m"),
        (SetTerrain.Request(floor=float("nan")), "base: expected a finite height"),
        (SetTerrain.Request(frame=7), "no frame 7"),
        (with_box(size=[1e-300, 1.0, 1.0]), "box 0: box size: expected positive side lengths"),
        (with_box(size=[1e9, 1.0, 1.0]), "box 0: box size"),
        (with_box(centre=[1e9, 0.0, 0.0]), "box 0: box centre: expected at most 1000 m"),
        (with_box(centre=[np.nan, 0.0, 0.0]), "box 0: box centre: expected finite numbers"),
        (with_box(yaw=float("nan")), "box 0: box yaw"),
        (SetTerrain.Request(boxes=20_000 * [TerrainBox(size=[1.0, 1.0, 1.0])]), "at most 64 boxes, found 20000"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_terrain_that_cannot_be_is_refused_with_the_reason_and_nothing_changes(start, until, request_, words):
    sim, peer = start()
    until(lambda: len(peer.truths) > 250)
    answer = peer.call(SetTerrain, "sim/set_terrain", request_, until)
    assert not answer.success
    assert words in answer.message
    assert sim._exchange.simulation.terrain == Terrain()


def test_a_senseless_box_is_refused_in_no_time():
    boxes = with_box(size=[1e-300, 1.0, 1.0]).boxes * 64
    began = time.perf_counter()
    with pytest.raises(ConfigurationError):
        terrain_from_message(boxes)
    assert time.perf_counter() - began < REFUSAL_TIME


def test_terrain_does_not_change_under_a_running_motion(start, until):
    sim, peer = start()
    until(lambda: len(peer.states) > 50)
    peer.results.publish(MotionResult(request_id="zero", outcome=MotionResult.STARTED))
    until(lambda: sim._selections.motion_runs)
    answer = peer.call(SetTerrain, "sim/set_terrain", ahead(PLATFORM.terrain), until)
    assert not answer.success
    assert "a motion runs" in answer.message
    assert sim._exchange.simulation.terrain == Terrain()
    peer.results.publish(MotionResult(request_id="zero", outcome=MotionResult.LANDED))
    until(lambda: not sim._selections.motion_runs)
    assert peer.call(SetTerrain, "sim/set_terrain", ahead(PLATFORM.terrain), until).success


def test_terrain_does_not_change_under_a_robot_that_moves(start, until):
    sim, peer = start()
    until(lambda: len(peer.truths) > 250)
    assert peer.call(SetBool, "sim/pause", SetBool.Request(data=True), until).success
    q, v = sim._exchange.simulation.state()
    v[0] = 0.5
    sim._exchange.simulation.set_state(q, v)
    answer = peer.call(SetTerrain, "sim/set_terrain", ahead(PLATFORM.terrain), until)
    assert not answer.success
    assert "the robot moves at 0.5 m/s" in answer.message


def test_the_world_may_have_terrain_from_the_start(start, until, tmp_path):
    file = tmp_path / "stairs.yaml"
    file.write_text("boxes:\n- {centre: [1.0, 0.0, 0.1], size: [0.5, 0.9, 0.2]}\n")
    sim, peer = start(terrain=str(file))
    until(lambda: len(peer.states) > 50)
    assert [box.top for box in sim._exchange.simulation.terrain.boxes] == [pytest.approx(0.2)]


@pytest.mark.parametrize("text", ["boxes: 5", "boxes:\n- {centre: [0, 0, 0]}", "hills: []"])
def test_a_terrain_file_that_makes_no_sense_leaves_the_node_unconfigured(executor, tmp_path, text):
    file = tmp_path / "terrain.yaml"
    file.write_text(text)
    sim = SimNode(parameter_overrides=[Parameter("terrain", value=str(file))])
    executor.add_node(sim)
    assert not sim.start()


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


def test_a_robot_that_does_not_exist_leaves_the_node_unconfigured(executor):
    sim = SimNode(parameter_overrides=[Parameter("robot", value="no_such_robot")])
    executor.add_node(sim)
    assert not sim.start()
