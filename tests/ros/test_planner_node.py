"""The planner's node in one process with its clients: every selection answered, previews, and nothing ends it."""

import time

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from aerial_model.robot.robot import Robot
from aerial_model.values.request import ControllerCommand, MotionRequest
from aerial_msgs.action import PlanMotion
from aerial_msgs.msg import MotionPlan, MotionResult, MotionSelection, TerrainBox
from aerial_planner.planner import Planner
from aerial_planner.ros import planner_node
from aerial_planner.ros.planner_node import PlannerNode
from aerial_ros import qos
from aerial_ros.messages import plan_from_message, result_to_message, selection_to_message, to_stamp

PATIENCE = 60.0  # [s] for a plan on a busy machine, its problems not built yet
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6  # action_msgs/GoalStatus
CROUCH = 0.05  # [rad] of the knees


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


class Operator(Node):
    def __init__(self):
        super().__init__("operator")
        self.results, self.plans, self.feedback = [], [], []
        self.create_subscription(MotionResult, "motion_result", self.results.append, qos.EVENT)
        self.create_subscription(MotionPlan, "motion_plan", self.plans.append, qos.EVENT)
        self.selections = self.create_publisher(MotionSelection, "motion_selection", qos.EVENT)
        self.odometry = self.create_publisher(Odometry, "odometry", qos.TELEMETRY)
        self.joint_states = self.create_publisher(JointState, "joint_states", qos.TELEMETRY)
        self.answers = self.create_publisher(MotionResult, "motion_result", qos.EVENT)  # the controller's
        self.previews = ActionClient(self, PlanMotion, "plan_motion")

    def preview(self, selection):
        goal = PlanMotion.Goal(selection=selection)
        return self.previews.send_goal_async(goal, feedback_callback=lambda m: self.feedback.append(m.feedback))


@pytest.fixture(scope="module")
def core(robot):
    """One planner for all tests: its problems are built once."""
    return Planner(robot)


@pytest.fixture
def planner(executor, core, monkeypatch):
    monkeypatch.setattr(planner_node, "Planner", lambda *_, **options: core)
    node = PlannerNode(parameter_overrides=[Parameter("warm_up", value="")])
    executor.add_node(node)
    assert node.start()
    yield node
    node.trigger_deactivate()
    node.trigger_cleanup()


@pytest.fixture
def operator(planner, executor, until):
    operator = Operator()
    executor.add_node(operator)
    until(lambda: operator.selections.get_subscription_count() and operator.count_publishers("motion_plan"))
    until(operator.previews.server_is_ready)
    return operator


@pytest.fixture
def ask(operator, until):
    """Publish a selection and return its first answer."""

    def ask(selection):
        operator.selections.publish(selection)
        until(lambda: operator.results and operator.results[-1].request_id == selection.request_id, PATIENCE)
        return operator.results[-1]

    return ask


def jump(request_id="1", **options):
    return selection_to_message(
        MotionRequest(**{"motion": "jump", "displacement": [0.3, 0.0, 0.0], "request_id": request_id, **options})
    )


def test_a_selection_gets_a_plan_and_is_told_so(operator, ask, until, robot):
    answer = ask(jump("a"))
    until(lambda: operator.plans)
    plan = plan_from_message(operator.plans[0], robot)
    assert (answer.outcome, answer.code, answer.reason) == (MotionResult.PLANNED, MotionResult.NONE, "")
    assert plan.request_id == "a"
    np.testing.assert_allclose(plan.landing_support_centre, [0.3, 0.0, 0.0], atol=1e-9)


def test_a_plan_is_repeated_until_a_controller_answers(operator, ask, executor, until, monkeypatch):
    monkeypatch.setattr(planner_node, "REPEAT_TIME", PATIENCE)
    ask(jump("a"))
    until(lambda: len(operator.plans) == 2)
    assert operator.plans[0] == operator.plans[1]
    operator.answers.publish(result_to_message("a", "jump", MotionResult.STARTED, to_stamp(0.0), None))
    until(lambda: operator.results[-1].outcome == MotionResult.STARTED)
    known = len(operator.plans)
    since = time.monotonic()
    until(lambda: time.monotonic() > since + 2 * planner_node.REPEAT_PERIOD)
    assert len(operator.plans) <= known + 1  # one may have been on its way


def test_without_an_estimate_the_plan_starts_from_the_home_stance(operator, ask, until, robot):
    ask(jump())
    until(lambda: operator.plans)
    start = plan_from_message(operator.plans[0], robot).start_joint_position
    np.testing.assert_array_equal(start, robot.poses["home"])


def test_the_plan_starts_from_the_estimate(operator, planner, ask, until, robot):
    crouched = robot.poses["home"] + np.tile([0.0, -CROUCH / 2, CROUCH], 4)
    standing = robot.standing_configuration()
    odometry = Odometry()
    odometry.pose.pose.position.z = standing[2]
    operator.odometry.publish(odometry)
    operator.joint_states.publish(
        JointState(name=list(robot.joint_names)[::-1], position=crouched[::-1].tolist(), velocity=[0.0] * 12)
    )
    until(lambda: planner._start() is not None)
    ask(jump())
    until(lambda: operator.plans)
    np.testing.assert_allclose(plan_from_message(operator.plans[0], robot).start_joint_position, crouched)


def with_nan(selection):
    selection.displacement[0] = np.nan
    return selection


def with_flat_box(selection):
    selection.terrain = [TerrainBox()]
    return selection


@pytest.mark.parametrize(
    ("selection", "code", "words"),
    [
        (jump(motion="jmup"), MotionResult.UNKNOWN_MOTION, "unknown motion 'jmup' (did you mean 'jump'?)"),
        (with_nan(jump()), MotionResult.INVALID_REQUEST, "expected finite numbers"),
        (with_flat_box(jump()), MotionResult.INVALID_REQUEST, "positive side lengths"),
        (jump(variant="XYZ"), MotionResult.INVALID_REQUEST, "unknown variant 'XYZ'"),
    ],
    ids=["misspelt", "not finite", "no extent", "variant"],
)
def test_what_cannot_be_is_refused_with_a_reason_and_the_next_selection_is_served(ask, selection, code, words):
    answer = ask(selection)
    assert (answer.outcome, answer.code) == (MotionResult.REFUSED, code)
    assert words in answer.reason
    assert ask(jump("next")).outcome == MotionResult.PLANNED


def test_a_goal_3_m_away_is_refused_with_what_binds(ask):
    answer = ask(jump(displacement=[3.0, 0.0, 0.0]))
    assert answer.outcome == MotionResult.REFUSED
    assert "what binds" in answer.reason


def test_a_fault_of_ours_is_quoted_and_does_not_end_the_node(planner, ask, monkeypatch):
    monkeypatch.setattr(planner._planner, "plan", lambda *_: 1 / 0)
    answer = ask(jump("a"))
    monkeypatch.undo()
    assert (answer.outcome, answer.code) == (MotionResult.REFUSED, MotionResult.INTERNAL)
    assert "ZeroDivisionError: division by zero" in answer.reason
    assert ask(jump("b")).outcome == MotionResult.PLANNED


def test_one_request_is_served_at_a_time(operator, until):
    operator.selections.publish(jump("first"))
    operator.selections.publish(jump("second"))
    until(lambda: len(operator.results) == 2, PATIENCE)
    answers = {result.request_id: result for result in operator.results}
    assert answers["first"].outcome == MotionResult.PLANNED
    assert answers["second"].code == MotionResult.BUSY


def test_what_the_controller_answers_is_left_to_it(operator, ask):
    for command in ControllerCommand:
        operator.selections.publish(jump(command, motion=command))
    ask(jump("mine"))
    assert [result.request_id for result in operator.results] == ["mine"]


def test_an_inactive_planner_answers_nothing(operator, planner, executor, ask):
    planner.trigger_deactivate()
    operator.selections.publish(jump("unheard"))
    for _ in range(20):
        executor.spin_once(timeout_sec=0.01)
    planner.trigger_activate()
    ask(jump("heard"))
    assert [result.request_id for result in operator.results] == ["heard"]


def test_a_preview_reports_its_stages_and_never_publishes_a_plan(operator, until, robot):
    sent = operator.preview(jump())
    until(sent.done)
    result = sent.result().get_result_async()
    until(result.done, PATIENCE)
    assert result.result().status == SUCCEEDED
    assert result.result().result.success
    plan_from_message(result.result().result.plan, robot)
    assert [feedback.stage for feedback in operator.feedback] == ["srbm", "kino_dynamic", "checked"]
    assert not operator.plans
    assert not operator.results


def test_a_refused_preview_says_why(operator, until):
    sent = operator.preview(jump(motion="jmup"))
    until(sent.done)
    result = sent.result().get_result_async()
    until(result.done, PATIENCE)
    assert result.result().status == ABORTED
    assert result.result().result.code == MotionResult.UNKNOWN_MOTION
    assert "did you mean 'jump'" in result.result().result.reason


def test_a_preview_can_be_cancelled(operator, until):
    sent = operator.preview(jump())
    until(sent.done)
    cancelled = sent.result().cancel_goal_async()
    result = sent.result().get_result_async()
    until(lambda: cancelled.done() and result.done(), PATIENCE)
    assert result.result().status == CANCELED


def test_a_robot_that_does_not_exist_leaves_the_node_unconfigured(executor):
    node = PlannerNode(parameter_overrides=[Parameter("robot", value="mini_cheeta")])
    executor.add_node(node)
    assert not node.start()
