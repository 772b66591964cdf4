"""The operator asks for terrain: a simulator has some, a robot has not."""

import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.values.terrain import Terrain
from aerial_msgs.msg import RobotState
from aerial_operator import terrain as subject
from aerial_operator.terrain import TerrainService
from aerial_ros import qos
from aerial_sim.ros.sim_node import SimNode

PLATFORM = Terrain.platform(0.16, 0.35, 0.0)


@pytest.fixture
def service(executor, until, monkeypatch):
    """The operator's end, on a node of the same executor."""
    monkeypatch.setattr(subject, "DISCOVERY_TIMEOUT", 2.0)
    node = Node("operator")
    executor.add_node(node)

    def wait(holds, timeout):
        try:
            until(holds, timeout)
        except AssertionError:
            return False
        return True

    return TerrainService(node, wait)


@pytest.fixture
def sim(executor):
    """A simulator whose time stands still: nobody commands it."""
    sim = SimNode(parameter_overrides=[Parameter("real_time", value=False), Parameter("noise", value="off")])
    executor.add_node(sim)
    assert sim.start()
    yield sim
    sim.trigger_deactivate()
    sim.trigger_cleanup()


def test_terrain_is_placed_and_can_be_put_back(sim, service):
    assert service.simulated
    before = service.place(PLATFORM)
    np.testing.assert_allclose(sim._exchange.simulation.terrain.height(np.array([[0.3, 0], [0.4, 0]])), [0, 0.16])
    service.call(before)
    assert sim._exchange.simulation.terrain == Terrain()


def test_a_refusal_is_an_error_with_the_simulators_sentence(sim, service):
    with pytest.raises(RefusalError, match=r"the simulator refuses the terrain: the ground .* would rise") as refusal:
        service.place(Terrain.platform(0.16, 0.0, 0.0))
    assert refusal.value.code is RefusalCode.INVALID_REQUEST


def test_a_robot_that_tells_its_state_itself_is_not_simulated(executor, service):
    driver = Node("driver")
    driver.create_publisher(RobotState, "state", qos.control(True))
    executor.add_node(driver)
    assert not service.simulated


def test_a_simulator_that_does_not_answer_is_said_to_be_silent(service):
    with pytest.raises(RefusalError, match="did not answer") as refusal:
        service.place(PLATFORM)
    assert refusal.value.code is RefusalCode.TIMEOUT
