"""The world's terrain, by service and by parameter."""

import time

import numpy as np
import pytest
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

from aerial_model.errors import ConfigurationError
from aerial_model.values.frame import StartFrame
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import Box, Terrain
from aerial_msgs.msg import MotionResult, TerrainBox
from aerial_msgs.srv import SetTerrain
from aerial_ros.messages import terrain_from_message, terrain_to_message
from aerial_sim.ros.sim_node import SimNode

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
