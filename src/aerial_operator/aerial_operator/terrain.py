"""The simulated world's terrain, as far as an operator has a say in it: a robot's own world has none to give."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.values.terrain import Terrain
from aerial_msgs.srv import SetTerrain
from aerial_operator.processes import SIMULATOR
from aerial_ros.messages import terrain_to_message

DISCOVERY_TIMEOUT = 8.0  # for the one who publishes states, and then for its service, to be found [s]
ANSWER_TIMEOUT = 8.0  # for the simulator to build a world and answer, on a machine whose cores are busy [s]

Wait = Callable[[Callable[[], bool], float], bool]  # serves messages until a condition holds, some seconds at most


class TerrainService:
    """Asks the simulator for terrain.

    Args:
        node: that asks.
        wait: serves messages until a condition holds or a time [s] is over; returns whether it holds.
    """

    def __init__(self, node: Node, wait: Wait) -> None:
        self._node = node
        self._wait = wait

    @property
    def simulated(self) -> bool:
        """Whether the robot is the simulator's: it is the one who publishes the states."""
        self._wait(lambda: bool(self._state_publishers()), DISCOVERY_TIMEOUT)
        return SIMULATOR.name in self._state_publishers()

    def place(self, terrain: Terrain) -> SetTerrain.Request:
        """Place a request's terrain around the robot as it stands now.

        Args:
            terrain: in the start heading frame.

        Returns:
            what puts the terrain back that was there before.

        Raises:
            RefusalError: if the simulator refuses, with its sentence, or does not answer.
        """
        request = SetTerrain.Request(frame=SetTerrain.Request.START_HEADING, boxes=terrain_to_message(terrain))
        before = self.call(request)
        return SetTerrain.Request(frame=SetTerrain.Request.WORLD, boxes=before.previous, floor=before.previous_floor)

    def call(self, request: SetTerrain.Request) -> SetTerrain.Response:
        """Return the simulator's answer.

        Raises:
            RefusalError: if the simulator refuses, with its sentence, or does not answer.
        """
        service = self._node.create_client(SetTerrain, f"{SIMULATOR.name}/set_terrain")
        try:
            if self._wait(service.service_is_ready, DISCOVERY_TIMEOUT):
                future = service.call_async(request)
                if self._wait(future.done, ANSWER_TIMEOUT):
                    return _granted(future.result())
        finally:
            self._node.destroy_client(service)
        raise RefusalError(RefusalCode.TIMEOUT, "the simulator did not answer the question for terrain")

    def _state_publishers(self) -> list[str]:
        return [end.node_name for end in self._node.get_publishers_info_by_topic("state")]


def _granted(response: SetTerrain.Response) -> SetTerrain.Response:
    if not response.success:
        raise RefusalError(RefusalCode.INVALID_REQUEST, f"the simulator refuses the terrain: {response.message}")
    return response
