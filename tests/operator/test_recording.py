"""A recording is read back by a reader that knows nothing but the file."""

import numpy as np
import pytest
import rclpy
from rclpy.experimental import EventsExecutor
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from aerial_msgs.msg import MotionPlan, MotionResult, RobotState
from aerial_operator.recording.recorder import Recorder
from aerial_operator.recording.recording import TOPICS, definition
from aerial_ros import qos
from aerial_ros.messages import doubles

COUNT = 50


@pytest.fixture
def recorder():
    """A recorder in a namespace, that has heard fifty states and one result."""
    context = rclpy.Context()
    rclpy.init(context=context)
    executor = EventsExecutor(context=context)
    node = rclpy.create_node("recorder", namespace="robot", context=context)
    executor.add_node(node)
    recorder = Recorder(node)
    states = node.create_publisher(RobotState, "state", qos.RECORD)
    results = node.create_publisher(MotionResult, "motion_result", qos.EVENT)
    while not (states.get_subscription_count() and results.get_subscription_count()):
        executor.spin_once(timeout_sec=0.05)
    for k in range(COUNT):
        states.publish(RobotState(sequence=k, joint_position=doubles(np.full(12, 0.1 * k))))
    results.publish(MotionResult(request_id="a", reason="so"))
    while len(recorder.arrivals("state")) < COUNT or not recorder.arrivals("motion_result"):
        executor.spin_once(timeout_sec=0.05)
    yield recorder
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)


@pytest.fixture
def bag(recorder, tmp_path):
    recorder.write(tmp_path / "bag")
    with Reader(tmp_path / "bag") as bag:
        yield bag


def test_messages_are_kept_in_order(recorder):
    assert [message.sequence for message in recorder.messages("state")] == list(range(COUNT))
    assert np.all(np.diff(recorder.arrivals("state")) >= 0)


def test_every_topic_is_in_the_bag_under_its_full_name(bag):
    assert {connection.topic for connection in bag.connections} == {f"/robot/{topic}" for topic in TOPICS}


def test_the_file_alone_tells_what_its_messages_mean(bag):
    types = get_typestore(Stores.EMPTY)
    for connection in bag.connections:
        types.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
    for connection in bag.connections:
        assert types.hash_rihs01(connection.msgtype) == connection.digest
    states = [
        types.deserialize_cdr(data, connection.msgtype)
        for connection, _, data in bag.messages()
        if connection.topic == "/robot/state"
    ]
    assert [state.sequence for state in states] == list(range(COUNT))
    np.testing.assert_allclose([state.joint_position[0] for state in states], 0.1 * np.arange(COUNT))


def test_a_second_recording_replaces_the_first(recorder, tmp_path):
    recorder.write(tmp_path / "bag")
    recorder.write(tmp_path / "bag")
    assert (tmp_path / "bag" / "bag.mcap").is_file()


@pytest.mark.parametrize("kind", [MotionPlan, RobotState])
def test_a_definition_is_the_installed_one_with_its_comments(kind):
    text, digest = definition(f"aerial_msgs/msg/{kind.__name__}")
    assert "#" in text
    assert digest.startswith("RIHS01_")


def test_a_definition_brings_the_types_it_uses():
    text, _ = definition("aerial_msgs/msg/MotionPlan")
    assert "MSG: aerial_msgs/TerrainBox" in text
