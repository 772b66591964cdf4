"""``aerial report``: a bag on disk has the verdict of the run it recorded, and what is no such bag is one sentence."""

import json

import numpy as np
import pytest
from rclpy.serialization import serialize_message

from aerial_evaluation.closed_loop import run
from aerial_evaluation.judgement.landing import judge
from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_msgs.msg import ControllerStatus, MotionResult
from aerial_operator.recording.recording import TOPICS, Recording, RecordingError
from aerial_operator.recording.verdict import motions
from aerial_ros.messages import plan_to_message, result_to_message, selection_to_message, to_stamp
from aerial_ros.wire import CommandWire, StateWire
from aerial_sim.ros.messages import ground_truth_to_message

NANO = 1_000_000_000
STATUS_TICKS = 10  # control periods between two statuses
JUMP = MotionRequest(motion="jump", displacement=[0.2, 0.0, 0.0], request_id="a")

BAG_TOLERANCE = 1e-5  # of figures [m, rad, °]: stamps are whole nanoseconds, a start is seen from its first tick on


@pytest.fixture(scope="module")
def record():
    """A jump in closed loop."""
    return run(Robot.load("mini_cheetah"), JUMP, noise="off")


def recorded(record, *, topics=TOPICS, until=np.inf, fallback_from=np.inf, refused=False):
    """What a recorder would keep of the run if nodes had made it, up to a time [s]."""
    recording = Recording({topic: f"/robot/{topic}" for topic in topics})
    state, command = StateWire(record.robot), CommandWire(record.robot)

    def keep(topic, time, data):
        if topic in topics and time <= until:
            recording.keep(topic, round(time * NANO), data if isinstance(data, bytes) else serialize_message(data))

    keep("motion_selection", record.start_time, selection_to_message(JUMP))
    keep("motion_plan", record.start_time, plan_to_message(record.plan, record.robot))
    if refused:
        other = MotionRequest(motion="jump", displacement=[9.0, 0.0, 0.0], request_id="b")
        refusal = RefusalError(RefusalCode.OUT_OF_REACH, "too far")
        answer = result_to_message("b", "jump", MotionResult.REFUSED, to_stamp(0.0), refusal)
        keep("motion_selection", 0.0, selection_to_message(other))
        keep("motion_result", 0.0, answer)
    for k, tick in enumerate(record.ticks):
        began, ended = tick.measurement.time, tick.truth.time
        keep("state", began, state.write(tick.measurement))
        keep("joint_command", began, command.write(tick.command))
        keep("ground_truth", ended, ground_truth_to_message(tick.truth, record.robot))
        if k % STATUS_TICKS == 0:
            in_plan = began - record.start_time
            running = 0 < in_plan <= record.plan.landing_time
            status = ControllerStatus(stamp=to_stamp(began), tick_time_p50=1e-4, tick_time_p99=2e-4, tick_time_max=3e-4)
            status.request_id, status.time_in_plan = ("a", in_plan) if running else ("", 0.0)
            status.fallback_ticks = 1 if began >= fallback_from else 0
            keep("controller_status", began, status)
    return recording


@pytest.fixture
def recording(record):
    return recorded(record)


@pytest.fixture
def bag(recording, tmp_path):
    recording.write(tmp_path / "bag")
    return tmp_path / "bag"


def test_a_bag_has_the_verdict_of_the_run_it_recorded(record, bag):
    (motion,) = motions(record.robot, Recording.read(bag))
    found, expected = motion.verdict.landing.to_json(), judge(record).to_json()
    assert found["checks"] == expected["checks"]
    for name in expected.keys() - {"checks", "landed"}:
        np.testing.assert_allclose(found[name], expected[name], rtol=0, atol=BAG_TOLERANCE)


def test_a_bag_has_the_commands_and_measurements_of_the_run(record, bag):
    (motion,) = motions(record.robot, Recording.read(bag))
    live = {round(tick.truth.time * NANO): tick for tick in record.ticks}
    for tick in motion.verdict.run.ticks:
        same = live[round(tick.truth.time * NANO)]
        np.testing.assert_array_equal(tick.command.torque, same.command.torque)
        np.testing.assert_array_equal(tick.measurement.joint_position, same.measurement.joint_position)


def test_a_counted_fallback_spoils_the_landing(record):
    (motion,) = motions(record.robot, recorded(record, fallback_from=record.start_time + 0.1))
    assert motion.verdict.landing.failed == ("no_fallback",)


def test_a_recording_is_read_as_it_was_written(recording, bag):
    there, here = Recording.read(bag), recording
    assert there.topics == here.topics
    for topic in TOPICS:
        assert there.serialized(topic) == here.serialized(topic)
        assert there.arrivals(topic) == here.arrivals(topic)


def test_report_succeeds_when_all_motions_landed(aerial, record, bag):
    ended = aerial("report", bag, "--json")
    assert ended.status == 0
    (row,) = ended.figures["motions"]
    assert ended.figures["landed"]
    assert (row["motion"], row["request_id"], row["landed"]) == ("jump", "a", True)
    assert row["tick_us"] == pytest.approx({"p50": 100.0, "p99": 200.0, "max": 300.0})
    np.testing.assert_allclose(row["landing_position_m"][:2], [0.2, 0.0], atol=judge(record).position_error + 0.01)
    assert "jump" in aerial("report", bag).output


def test_report_fails_when_one_motion_was_refused(aerial, record, tmp_path):
    recorded(record, refused=True).write(tmp_path / "bag")
    ended = aerial("report", tmp_path / "bag", "--json")
    assert ended.status == 1
    refused = next(row for row in ended.figures["motions"] if row["request_id"] == "b")
    assert refused["refusal"] == {"code": "out_of_reach", "reason": "too far"}
    assert not refused["landed"]
    assert "no, refused: too far" in aerial("report", tmp_path / "bag").output


def test_the_robot_of_a_recording_is_checked(aerial, bag):
    ended = aerial("report", bag, "--robot", "mit_humanoid")
    assert ended.status == 1
    assert ended.errors.count("\n") == 1


@pytest.mark.parametrize("found", ["no such folder", "a folder without metadata.yaml"])
def test_what_is_no_recording_is_one_sentence(aerial, tmp_path, found):
    folder = tmp_path / "bag"
    if "without" in found:
        folder.mkdir()
    ended = aerial("report", folder)
    assert ended.status == 1
    assert ended.errors == f"aerial: {folder}: expected a recording (a rosbag2 folder), found {found}\n"


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.999])
def test_a_file_that_was_cut_off_is_one_sentence(aerial, bag, share):
    file = bag / "bag.mcap"
    file.write_bytes(file.read_bytes()[: int(share * file.stat().st_size)])
    ended = aerial("report", bag)
    assert ended.status == 1
    assert "damaged or cut off" in ended.errors
    assert ended.errors.count("\n") == 1


def test_metadata_that_was_overwritten_is_one_sentence(bag):
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: 3")
    with pytest.raises(RecordingError, match="damaged or cut off"):
        Recording.read(bag)


@pytest.mark.parametrize(
    ("kept", "sentence"),
    [
        ({"topics": [topic for topic in TOPICS if topic != "ground_truth"]}, "no ground truth of 'jump'"),
        ({"until": 1.5}, "a landing is judged from 0.500 s to"),
        ({"topics": ["odometry"]}, None),
    ],
)
def test_a_recording_that_lacks_what_a_verdict_needs_is_one_sentence(aerial, record, tmp_path, kept, sentence):
    recorded(record, **kept).write(tmp_path / "bag")
    ended = aerial("report", tmp_path / "bag", "--json")
    assert ended.status == 1
    assert not json.loads(ended.output).get("landed", False)
    if sentence is not None:
        assert sentence in ended.errors
        assert ended.errors.count("\n") == 1


def test_two_robots_in_one_bag_are_told_apart(record, tmp_path):
    names = {"ground_truth": "/one/ground_truth", "state": "/two/state"}
    Recording(names).write(tmp_path / "bag")
    with pytest.raises(RecordingError, match=r"expected one robot's topics, found /one/… and /two/…"):
        Recording.read(tmp_path / "bag")
