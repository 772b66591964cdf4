"""The three nodes in one process and in lock-step: a jump onto a platform lands, and the same seed gives the same jump."""

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

from aerial_evaluation.judgement.landing import OBSERVE_TIME, judge
from aerial_evaluation.record import Run, Tick
from aerial_model.robot.robot import Robot
from aerial_model.timing import CONTROL_PERIOD
from aerial_model.values.frame import StartFrame
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import Terrain
from aerial_msgs.msg import GroundTruth, JointCommand, MotionPlan, MotionResult, MotionSelection, RobotState
from aerial_msgs.srv import SetTerrain, Step
from aerial_planner.ros.planner_node import PlannerNode
from aerial_ros import qos
from aerial_ros.messages import from_stamp, plan_from_message, selection_to_message, terrain_to_message
from aerial_sim.ros.messages import ground_truth_from_message
from aerial_sim.ros.sim_node import SimNode
from aerial_wbic.ros.wbic_node import WbicNode

PATIENCE = 120.0  # [s] for a jump on a busy machine
STAND_PERIODS = 250  # before the selection
HEARD_SHARE = 0.9  # of states and commands: a listener beside the loop may miss some
JUMP = MotionRequest(
    motion="jump", displacement=[0.6, 0.0, 0.16], terrain=Terrain.platform(0.16, 0.38, 0.0), request_id="jump"
)


class Operator(Node):
    """Selects a motion and keeps what comes of it."""

    def __init__(self):
        super().__init__("operator")
        self.truths, self.plans, self.results = [], [], []
        self.states, self.commands = {}, {}  # by number: what nobody has answered comes again
        self.create_subscription(GroundTruth, "ground_truth", self.truths.append, qos.RECORD)
        self.create_subscription(RobotState, "state", self._on_state, qos.RECORD)
        self.create_subscription(JointCommand, "joint_command", self._on_command, qos.RECORD)
        self.create_subscription(MotionPlan, "motion_plan", self.plans.append, qos.EVENT)
        self.create_subscription(MotionResult, "motion_result", self.results.append, qos.EVENT)
        self.selections = self.create_publisher(MotionSelection, "motion_selection", qos.EVENT)

    def _on_state(self, state):
        self.states[state.sequence] = state

    def _on_command(self, command):
        self.commands[command.state_sequence] = command

    @property
    def outcomes(self):
        return [result.outcome for result in self.results]

    @property
    def time(self):
        return from_stamp(self.truths[-1].odometry.header.stamp) if self.truths else 0.0


@pytest.fixture
def jump(executor, until):
    """Run the jump from a new start of all nodes and return the operator."""
    options = {"real_time": False, "seed": 3, "warm_up": "jump"}
    parameters = [Parameter(name, value=value) for name, value in options.items()]

    def call(operator, kind, name, request):
        client = operator.create_client(kind, name)
        until(client.service_is_ready)
        future = client.call_async(request)
        until(future.done)
        assert future.result().success

    def jump():
        nodes = [kind(parameter_overrides=parameters) for kind in (SimNode, WbicNode, PlannerNode)]
        operator = Operator()
        for node in (*nodes, operator):
            executor.add_node(node)
        sim, *others = nodes
        assert sim.start()
        call(operator, SetBool, "sim/pause", SetBool.Request(data=True))
        assert all(node.start() for node in others)
        until(lambda: operator.count_subscribers("motion_selection") >= 2 and sim.diagnose()[1] == "paused")
        call(operator, Step, "sim/step", Step.Request(count=STAND_PERIODS))
        until(lambda: len(operator.truths) == STAND_PERIODS)
        boxes = terrain_to_message(JUMP.terrain)
        placing = SetTerrain.Request(frame=SetTerrain.Request.START_HEADING, boxes=boxes)
        call(operator, SetTerrain, "sim/set_terrain", placing)
        operator.selections.publish(selection_to_message(JUMP))
        until(lambda: MotionResult.STARTED in operator.outcomes, PATIENCE)
        call(operator, SetBool, "sim/pause", SetBool.Request(data=False))
        start = from_stamp(operator.truths[-1].odometry.header.stamp)
        until(lambda: operator.time > start + operator.plans[0].landing_time + OBSERVE_TIME, PATIENCE)
        for node in nodes:
            node.trigger_deactivate()
            node.trigger_cleanup()
        for node in (*nodes, operator):
            executor.remove_node(node)
            node.destroy_node()
        return operator

    return jump


def test_a_jump_lands_and_repeats_to_the_last_bit(jump):
    robot = Robot.load("mini_cheetah")
    first, second = jump(), jump()
    plan = plan_from_message(first.plans[0], robot)
    truths = [ground_truth_from_message(message) for message in first.truths]
    start = STAND_PERIODS - 1
    frame = StartFrame.of(robot, truths[start].q)
    ticks = [Tick(truth=truth) for truth in truths]
    landing = judge(Run(robot=robot, plan=plan, start_frame=frame, start_time=truths[start].time, ticks=ticks))
    assert landing.failed == ()
    assert first.plans == second.plans
    until_judged = STAND_PERIODS + round((plan.landing_time + OBSERVE_TIME) / CONTROL_PERIOD)
    assert len(first.truths) >= until_judged
    assert len(second.truths) >= until_judged
    assert first.truths[:until_judged] == second.truths[:until_judged]
    for one, other in ((first.states, second.states), (first.commands, second.commands)):
        heard = [number for number in range(until_judged) if number in one and number in other]
        assert len(heard) > HEARD_SHARE * until_judged
        assert all(one[number] == other[number] for number in heard)
