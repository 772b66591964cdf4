"""The three nodes as processes over DDS, started as ``ros2 run`` would, in lock-step so that a busy machine can follow."""

import os
import shutil
import signal
import subprocess

import numpy as np
import pytest
import yaml

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.robot.loading import known_robots
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import Terrain
from aerial_msgs.msg import ControllerStatus, MotionPlan
from aerial_operator import client as operator_client
from aerial_operator.client import connected
from aerial_operator.processes import PLANNER, PROGRAMS, SIMULATOR, NodeProcesses, parameters
from aerial_operator.recording.recorder import Recorder
from aerial_operator.recording.recording import Recording
from aerial_operator.recording.runs import execution
from aerial_operator.recording.verdict import motions, verdicts
from aerial_operator.terrain import TerrainService
from aerial_ros import qos
from aerial_sim.ros.messages import ground_truth_from_message

PATIENCE = 120.0  # [s] for anything to happen on a busy machine
STANDING_TIME = 1.0  # simulated, for which a robot must stand to be said to stand on [s]
HEIGHT_TOLERANCE = 0.02  # [m]
FORWARD = MotionRequest(motion="jump", displacement=[0.3, 0.0, 0.0])


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return tmp_path_factory.mktemp("nodes") / "log"


@pytest.fixture(scope="module")
def nodes(log):
    told = parameters("mini_cheetah", seed=5, noise="nominal", real_time=False)
    told[PLANNER.name]["warm_up"] = "jump"
    with log.open("w") as file, NodeProcesses(told, file) as nodes:
        yield nodes


@pytest.fixture(scope="module")
def client(nodes):
    with connected() as client:
        yield client


@pytest.fixture(scope="module")
def recorder(client):
    return Recorder(client)


@pytest.fixture(scope="module")
def jumped(client, recorder, robot):
    """A forward jump, observed to its end."""
    assert client.wait(lambda: not client.missing, PATIENCE), client.missing
    request_id, answers = client.select(FORWARD)
    done = execution(robot, recorder, request_id)
    assert client.wait(lambda: client.time > done.end_time, PATIENCE)
    return answers, *verdicts(robot, recorder, [done])


@pytest.fixture
def stands_on(client, recorder, robot):
    """Wait while time goes on; return whether the robot stood all the while."""

    def stands_on():
        since = client.time
        assert client.wait(lambda: client.time > since + STANDING_TIME, PATIENCE), "time does not go on"
        truths = map(ground_truth_from_message, recorder.messages("ground_truth"))
        height = np.array([truth.q[2] for truth in truths if truth.time > since])
        standing = robot.standing_configuration()[2]
        upright = bool(np.all(np.abs(height - standing) < HEIGHT_TOLERANCE))
        return upright and client.status.phase == ControllerStatus.STAND

    return stands_on


def test_a_jump_is_planned_started_and_landed(jumped):
    answers, _ = jumped
    assert [answer.outcome for answer in answers] == ["planned", "started", "landed"]


def test_it_lands_by_ground_truth(jumped):
    _, verdict = jumped
    assert verdict.landing.failed == ()


def test_its_figures_are_those_of_simulate(jumped):
    _, verdict = jumped
    figures = verdict.to_json()
    assert figures["landed"]
    assert figures["tick_us"]["p50"] > 0
    assert figures["plan"]["peak_torque_ratio"] < 1


def test_the_bag_of_the_run_has_the_verdict_of_the_live_run(jumped, recorder, robot, tmp_path):
    _, verdict = jumped
    recorder.write(tmp_path / "bag")
    (motion,) = motions(robot, Recording.read(tmp_path / "bag"))
    assert motion.outcome == "landed"
    assert motion.verdict.to_json() == verdict.to_json()
    assert [tick.command is None for tick in motion.verdict.run.ticks] == [
        tick.command is None for tick in verdict.run.ticks
    ]


def test_a_misspelt_motion_is_one_sentence_and_the_robot_stands_on(jumped, client, stands_on):
    _, (answer,) = client.select(MotionRequest(motion="jmup"))
    assert (answer.outcome, answer.code) == ("refused", RefusalCode.UNKNOWN_MOTION)
    assert "did you mean 'jump'" in answer.reason
    assert stands_on()


def test_a_goal_3_m_away_is_refused_and_the_robot_stands_on(jumped, client, stands_on):
    _, (answer,) = client.select(MotionRequest(motion="jump", displacement=[3.0, 0.0, 0.0]))
    assert answer.outcome == "refused"
    assert answer.code in (RefusalCode.OUT_OF_REACH, RefusalCode.NO_SOLUTION)
    assert stands_on()


def test_the_terrain_of_a_selection_that_is_refused_is_gone_again(jumped, client, stands_on):
    too_far = MotionRequest(motion="jump", displacement=[3.0, 0.0, 0.16], terrain=Terrain.platform(0.16, 2.5, 0.0))
    _, (answer,) = client.select(too_far)
    assert answer.outcome == "refused"
    assert TerrainService(client, client.wait).place(Terrain()).boxes == []
    assert stands_on()


def test_terrain_that_would_run_through_the_robot_is_refused_by_the_simulator(jumped, client, stands_on):
    onto_itself = MotionRequest(motion="jump", displacement=[0.4, 0.0, 0.16], terrain=Terrain.platform(0.16, 0.0, 0.0))
    _, (answer,) = client.select(onto_itself)
    assert (answer.outcome, answer.code) == ("refused", RefusalCode.INVALID_REQUEST)
    assert "the simulator refuses the terrain: the ground under the robot's feet would rise" in answer.reason
    assert stands_on()


def test_a_plan_with_a_nan_is_refused_and_the_robot_stands_on(jumped, client, recorder, stands_on):
    plan, *_ = recorder.messages("motion_plan")  # the planner repeats it until the controller answers
    plan.request_id = "nan"
    plan.q[40] = np.nan
    publisher = client.create_publisher(MotionPlan, "motion_plan", qos.EVENT)
    assert client.wait(lambda: publisher.get_subscription_count() > 1, PATIENCE)
    publisher.publish(plan)
    answers = lambda: [result for result in recorder.messages("motion_result") if result.request_id == "nan"]  # noqa: E731
    assert client.wait(answers, PATIENCE)
    assert "plan field q: not finite" in answers()[0].reason
    assert stands_on()


def test_without_its_planner_the_robot_stands_on_and_a_selection_says_who_is_silent(
    jumped, nodes, client, stands_on, monkeypatch
):
    os.kill(nodes.pid(PLANNER), signal.SIGKILL)
    assert client.wait(lambda: not nodes.running(PLANNER), PATIENCE)
    assert stands_on()
    ((program, sentence),) = nodes.newly_dead()
    assert program is PLANNER
    assert sentence.startswith("planner_node ended (signal SIGKILL): nothing can be planned any more")
    monkeypatch.setattr(operator_client, "PLANNING_TIMEOUT", 0.5)
    monkeypatch.setattr(operator_client, "DISCOVERY_TIMEOUT", 0.5)
    with pytest.raises(RefusalError, match=r"the planner did not answer|no planner is running") as refusal:
        client.select(FORWARD)
    assert refusal.value.code is RefusalCode.TIMEOUT


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.executable)
def test_a_robot_folder_without_a_key_ends_a_node_with_one_sentence(program, tmp_path):
    folder = shutil.copytree(known_robots()["mini_cheetah"], tmp_path / "robot")
    data = yaml.safe_load((folder / "robot.yaml").read_text())
    del data["poses"]
    (folder / "robot.yaml").write_text(yaml.safe_dump(data))
    command = [program.path, "--ros-args", "-p", f"robot:={folder}"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert ended.returncode == 1
    assert "key 'poses' is missing" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_node_told_to_end_ends_in_order(jumped, nodes, client, log):
    os.kill(nodes.pid(SIMULATOR), signal.SIGTERM)
    assert client.wait(lambda: not nodes.running(SIMULATOR), PATIENCE)
    ((_, sentence),) = nodes.newly_dead()
    assert "exit status 0" in sentence
    assert "Traceback" not in log.read_text()
