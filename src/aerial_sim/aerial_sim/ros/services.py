"""The simulator's services: what a person or a program may do to time, to the robot and to the world."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from rclpy.node import Node
from rclpy.service import Service
from std_srvs.srv import SetBool

from aerial_model.errors import ConfigurationError
from aerial_model.robot.robot import BASE_LINEAR
from aerial_model.values.terrain import Terrain
from aerial_msgs.srv import Disturb, Reset, SetTerrain, Step
from aerial_ros.messages import terrain_from_message, terrain_to_message, to_stamp
from aerial_sim.exchange import Exchange
from aerial_sim.ros.selections import Selections
from aerial_sim.world.placement import placed

REST_SPEED_MAX = 0.1  # of the base, at which a robot still counts as standing or lying still [m/s]

Response = TypeVar("Response", Disturb.Response, SetTerrain.Response)


class Services:
    """Answers service calls on an exchange that the node shares with them.

    Args:
        exchange: of the simulated robot.
        selections: that say whether a motion runs.
        lock: that guards both.
        go_on: called when time may have become free.
        restarted: called, under the lock, when the robot was put back to its start.
    """

    def __init__(
        self,
        exchange: Exchange,
        selections: Selections,
        lock: threading.RLock,
        *,
        go_on: Callable[[], None],
        restarted: Callable[[], None],
    ) -> None:
        self._exchange = exchange
        self._selections = selections
        self._lock = lock
        self._go_on = go_on
        self._restarted = restarted

    def open(self, node: Node) -> list[Service]:
        """Return the services of ``node``, ready to be called."""
        return [
            node.create_service(Reset, "~/reset", self._reset),
            node.create_service(SetBool, "~/pause", self._pause),
            node.create_service(Step, "~/step", self._step),
            node.create_service(Disturb, "~/disturb", self._disturb),
            node.create_service(SetTerrain, "~/set_terrain", self._set_terrain),
        ]

    def _reset(self, request: Reset.Request, response: Reset.Response) -> Reset.Response:
        with self._lock:
            self._exchange.reset(request.seed)
            self._selections.reset()
            self._restarted()
        response.success = True
        return response

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        with self._lock:
            self._exchange.paused = request.data
        self._go_on()
        response.success = True
        return response

    def _step(self, request: Step.Request, response: Step.Response) -> Step.Response:
        """Grant a paused simulation some periods; the answer's stamp is the time at which it will stand again."""
        with self._lock:
            exchange, simulation = self._exchange, self._exchange.simulation
            if not exchange.paused:
                response.message = "the simulation is not paused"
            elif not exchange.started:
                response.message = "no joint_command has come yet"
            else:
                exchange.granted += request.count
                response.success = True
            response.stamp = to_stamp(simulation.time + exchange.granted * simulation.control_dt)
        self._go_on()
        return response

    def _disturb(self, request: Disturb.Request, response: Disturb.Response) -> Disturb.Response:
        return self._attempt(response, lambda: self._apply(request))

    def _set_terrain(self, request: SetTerrain.Request, response: SetTerrain.Response) -> SetTerrain.Response:
        with self._lock:
            present = self._exchange.simulation.terrain
            response.previous, response.previous_floor = terrain_to_message(present), present.base
            return self._attempt(response, lambda: self._place(request))

    def _attempt(self, response: Response, act: Callable[[], None]) -> Response:
        """Act under the lock; answer success, or the sentence that says why nothing was changed."""
        try:
            with self._lock:
                act()
        except ConfigurationError as error:
            response.message = str(error)
        response.success = not response.message
        return response

    def _apply(self, request: Disturb.Request) -> None:
        numbers = [*request.force, request.duration, request.added_mass, request.friction_coefficient]
        if not np.isfinite(numbers).all():
            raise ConfigurationError("expected finite numbers")
        if request.duration < 0 or request.friction_coefficient < 0:
            raise ConfigurationError("duration and friction coefficient must not be negative")
        self._exchange.simulation.disturb(
            np.array(request.force) if request.duration > 0 else None,
            request.duration,
            added_mass=request.added_mass if request.has_added_mass else None,
            friction_coefficient=request.friction_coefficient if request.has_friction_coefficient else None,
        )

    def _place(self, request: SetTerrain.Request) -> None:
        simulation = self._exchange.simulation
        if self._selections.motion_runs:
            raise ConfigurationError("a motion runs: the terrain is changed while the robot stands or lies still")
        q, v = simulation.state()
        speed = float(np.linalg.norm(v[BASE_LINEAR]))
        if speed > REST_SPEED_MAX:
            raise ConfigurationError(f"the robot moves at {speed:.1f} m/s: the terrain is changed while it is still")
        terrain = _requested(request)
        if request.frame == SetTerrain.Request.START_HEADING:
            terrain = placed(simulation.robot, q, simulation.terrain, terrain)
        simulation.set_terrain(terrain)


def _requested(request: SetTerrain.Request) -> Terrain:
    """Return the terrain that a request asks for, in the frame it names."""
    if request.frame == SetTerrain.Request.WORLD:
        return terrain_from_message(request.boxes, request.floor)
    if request.frame == SetTerrain.Request.START_HEADING:
        return terrain_from_message(request.boxes)
    raise ConfigurationError(f"no frame {request.frame}; there are 0 (WORLD) and 1 (START_HEADING)")
