"""The controller's node against the simulator's, in one process and in lock-step."""

import dataclasses

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_msgs.msg import (
    ControllerStatus,
    GroundTruth,
    JointCommand,
    MotionPlan,
    MotionResult,
    MotionSelection,
    RobotState,
)
from aerial_planner.planner import Planner
from aerial_ros import qos
from aerial_ros.messages import plan_to_message, selection_to_message
from aerial_sim.ros.sim_node import SimNode
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.ros.wbic_node import WbicNode

PATIENCE = 60.0  # [s] a motion in lock-step on a busy machine
HEIGHT_TOLERANCE = 0.01  # [m]


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture(scope="module")
def plan(robot):
    request = MotionRequest(motion="jump", displacement=[0.2, 0.0, 0.0], request_id="jump")
    return Planner(robot).plan(request).plan


class Operator(Node):
    """Selects, sends plans, and keeps what it hears."""

    def __init__(self):
        super().__init__("operator")
        self.plans = self.create_publisher(MotionPlan, "motion_plan", qos.EVENT)
        self.selections = self.create_publisher(MotionSelection, "motion_selection", qos.EVENT)
        self.states = self.create_publisher(RobotState, "state", qos.control(False))
        self.results, self.statuses, self.odometry, self.commands, self.truths = [], [], [], [], []
        self.create_subscription(MotionResult, "motion_result", self.results.append, qos.EVENT)
        self.create_subscription(ControllerStatus, "controller_status", self.statuses.append, qos.TELEMETRY)
        self.create_subscription(Odometry, "odometry", self.odometry.append, qos.TELEMETRY)
        self.create_subscription(JointCommand, "joint_command", self.commands.append, qos.control(False))
        self.create_subscription(GroundTruth, "ground_truth", self.truths.append, qos.RECORD)

    def outcomes(self, request_id):
        return [result.outcome for result in self.results if result.request_id == request_id]

    def select(self, motion):
        self.selections.publish(selection_to_message(MotionRequest(motion=motion, request_id=motion)))

    def call(self, name, until):
        client = self.create_client(Trigger, name)
        until(client.service_is_ready)
        future = client.call_async(Trigger.Request())
        until(future.done)
        return future.result()

    @property
    def height(self):
        return self.truths[-1].odometry.pose.pose.position.z


@pytest.fixture
def running(executor, until):
    """Controller and operator, with the simulator in lock-step; the robot stands."""
    parameters = [Parameter("real_time", value=False), Parameter("noise", value="off")]
    sim = SimNode(parameter_overrides=parameters)
    wbic = WbicNode(parameter_overrides=parameters[:1])
    operator = Operator()
    for node in (sim, wbic, operator):
        executor.add_node(node)
    assert wbic.start()
    assert sim.start()
    until(lambda: operator.statuses and operator.statuses[-1].ticks > 50)
    yield wbic, operator
    for node in (sim, wbic):
        node.trigger_deactivate()
        node.trigger_cleanup()


def test_it_stands_and_reports(running, robot):
    _, operator = running
    assert operator.statuses[-1].phase == ControllerStatus.STAND
    assert operator.statuses[-1].robot == robot.name
    assert operator.statuses[-1].fallback_ticks == 0
    assert operator.height == pytest.approx(robot.standing_configuration()[2], abs=HEIGHT_TOLERANCE)
    assert operator.odometry[-1].header.frame_id == "odom"
    assert operator.odometry[-1].pose.pose.position.z == pytest.approx(operator.height, abs=HEIGHT_TOLERANCE)


def test_a_command_answers_the_state_it_names(running, until):
    _, operator = running
    operator.commands.clear()
    until(lambda: len(operator.commands) > 50)
    sequences = [command.state_sequence for command in operator.commands]
    assert sequences == sorted(sequences)
    assert all(command.stamp == command.state_stamp for command in operator.commands)


def test_a_plan_is_started_and_landed(running, plan, robot, until):
    _, operator = running
    operator.plans.publish(plan_to_message(plan, robot))
    until(lambda: operator.outcomes("jump") == [MotionResult.STARTED])
    until(lambda: len(operator.outcomes("jump")) == 2, PATIENCE)
    assert operator.outcomes("jump")[-1] == MotionResult.LANDED
    phases = list(dict.fromkeys(status.phase for status in operator.statuses))
    assert phases == [Phase.STAND, Phase.TAKE_OFF, Phase.FLIGHT, Phase.LANDING]


@pytest.mark.parametrize(
    ("change", "code", "word"),
    [
        (lambda plan: {"com": np.where(plan.com == plan.com[3], np.nan, plan.com)}, MotionResult.INVALID_PLAN, "com"),
        (lambda plan: {"model_hash": "another"}, MotionResult.WRONG_ROBOT, "another"),
        (lambda plan: {"q": plan.q + 0.3 * (np.arange(19) == 9)}, MotionResult.START_MISMATCH, "joint"),
        (lambda plan: {"time": plan.time[::-1].copy()}, MotionResult.INVALID_PLAN, "time"),
    ],
)
def test_a_bad_plan_is_refused_and_the_robot_stands_on(running, plan, robot, until, change, code, word):
    _, operator = running
    operator.plans.publish(plan_to_message(dataclasses.replace(plan, **change(plan)), robot))
    until(lambda: operator.results)
    assert operator.results[-1].outcome == MotionResult.REFUSED
    assert operator.results[-1].code == code
    assert word in operator.results[-1].reason
    before = operator.statuses[-1].ticks
    until(lambda: operator.statuses[-1].ticks > before + 100)
    assert operator.statuses[-1].phase == ControllerStatus.STAND


def test_a_second_plan_is_refused_while_one_runs(running, plan, robot, until):
    _, operator = running
    operator.plans.publish(plan_to_message(plan, robot))
    operator.plans.publish(plan_to_message(dataclasses.replace(plan, request_id="second"), robot))
    until(lambda: operator.outcomes("second"))
    assert operator.results[-1].code == MotionResult.BUSY


def test_a_motion_is_aborted_on_the_ground(running, plan, robot, until):
    _, operator = running
    operator.plans.publish(plan_to_message(plan, robot))
    until(lambda: operator.outcomes("jump"))
    operator.select("abort")
    until(lambda: operator.outcomes("abort") == [MotionResult.STARTED, MotionResult.LANDED], PATIENCE)
    assert operator.outcomes("jump") == [MotionResult.STARTED, MotionResult.ABORTED]


def test_it_lies_down_and_stands_up(running, robot, until):
    _, operator = running
    operator.select("lie_down")
    until(lambda: operator.outcomes("lie_down") == [MotionResult.STARTED, MotionResult.LANDED], PATIENCE)
    operator.select("jump")  # the planner's business
    operator.select("stand_up")
    until(lambda: operator.outcomes("stand_up") == [MotionResult.STARTED, MotionResult.LANDED], PATIENCE)
    assert operator.outcomes("jump") == []
    assert operator.height == pytest.approx(robot.standing_configuration()[2], abs=HEIGHT_TOLERANCE)


def test_a_command_that_makes_no_sense_now_is_refused(running, until):
    _, operator = running
    operator.select("stand_up")
    until(lambda: operator.outcomes("stand_up"))
    assert operator.results[-1].outcome == MotionResult.REFUSED
    assert "STAND" in operator.results[-1].reason


def test_an_emergency_stop_latches_until_reset(running, plan, robot, until):
    _, operator = running
    assert operator.call("wbic/emergency_stop", until).success
    until(lambda: operator.statuses[-1].phase == ControllerStatus.STOPPED)
    operator.plans.publish(plan_to_message(plan, robot))
    until(lambda: operator.outcomes("jump") == [MotionResult.REFUSED])
    assert not np.any(operator.commands[-1].torque)
    assert operator.call("wbic/reset", until).success
    until(lambda: operator.statuses[-1].phase == ControllerStatus.STAND)


def test_a_state_that_makes_no_sense_is_ignored(running, robot, until):
    wbic, operator = running
    n = robot.n_joints
    joints = {name: [float("nan")] * n for name in ("joint_position", "joint_velocity", "joint_torque")}
    operator.states.publish(RobotState(sequence=10**6, orientation=np.array([0.0, 0.0, 0.0, 1.0]), **joints))
    before = operator.statuses[-1].ticks
    until(lambda: operator.statuses[-1].ticks > before + 100)
    assert operator.statuses[-1].missed_ticks < 1000  # not the million that the sequence number claims
    until(lambda: wbic.diagnose()[1] != "no state arrives")  # a machine that is busy may be silent for a moment
