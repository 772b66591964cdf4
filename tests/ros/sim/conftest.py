"""The simulator's node and a peer that answers its states."""

import dataclasses

import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import String

from aerial_model.robot.robot import Robot
from aerial_model.values.command import Command
from aerial_msgs.msg import GroundTruth, JointCommand, MotionResult, MotionSelection, RobotState
from aerial_ros import qos
from aerial_ros.wire import CommandWire
from aerial_sim.ros.sim_node import SimNode


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
