"""The controller as a process: a state in, a joint command out; plans and selections in, answers out.

The arrival of a state drives everything; a timer only watches for silence. Nothing that arrives ends the node: what
makes no sense is answered or logged, and the robot goes on standing.
"""

from __future__ import annotations

import gc
import time
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from std_srvs.srv import Trigger

from aerial_model.errors import InvalidPlanError, RefusalCode, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.command import Command
from aerial_model.values.measurement import Measurement
from aerial_model.values.request import ControllerCommand
from aerial_msgs.msg import ControllerStatus, JointCommand, MotionPlan, MotionResult, MotionSelection, RobotState
from aerial_ros import node, qos
from aerial_ros.messages import plan_from_message, result_to_message, to_stamp
from aerial_ros.wire import CommandWire, StateWire
from aerial_wbic.controller import Controller
from aerial_wbic.requests import Answer, Outcome, Requests
from aerial_wbic.ros.messages import Pace, odometry_to_message, status_to_message

ODOMETRY_TICKS = 5  # ticks from one odometry to the next
STATUS_TICKS = 10  # ticks from one status to the next
SILENCE = 0.2  # wall time without a state from which the node says so [s]
MISSED_SHARE_MAX = 0.005  # of the states; beyond it diagnostics warn
QUATERNION_TOLERANCE = 1e-3  # deviation of the squared norm from 1
MICRO = 1e6  # microseconds in a second


class WbicNode(node.AerialNode):
    """Controls a robot.

    Parameters: ``real_time`` (false: lock-step; must be the simulator's), and those of every node.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("wbic", **options)
        self.declare_parameter("real_time", True)

    # --- life --------------------------------------------------------------------------------------------------------

    def configure(self) -> None:
        """Load the robot, make the controller, open the interfaces."""
        self._robot = Robot.load(self.get_parameter("robot").value)
        self._controller = Controller(self._robot)
        self._state_wire, self._command_wire = StateWire(self._robot), CommandWire(self._robot)
        self._active = False
        control = qos.control(self.get_parameter("real_time").value)
        publisher, subscription = self.create_lifecycle_publisher, self.create_subscription
        self._commands = publisher(JointCommand, "joint_command", control)
        self._statuses = publisher(ControllerStatus, "controller_status", qos.TELEMETRY)
        self._odometry = publisher(Odometry, "odometry", qos.TELEMETRY)
        self._results = publisher(MotionResult, "motion_result", qos.ANSWER)
        self._outputs = [self._commands, self._statuses, self._odometry, self._results]
        self._inputs = [
            subscription(RobotState, "state", self._on_state, control, raw=True),
            subscription(MotionPlan, "motion_plan", self._on_plan, qos.EVENT),
            subscription(MotionSelection, "motion_selection", self._on_selection, qos.EVENT),
        ]
        self._services_made = [
            self.create_service(Trigger, "~/emergency_stop", self._emergency_stop),
            self.create_service(Trigger, "~/reset", self._reset),
        ]
        self._watch = self.create_timer(SILENCE, self._watch_for_silence)

    def activate(self) -> None:
        """Answer states from now on, without being held up by the garbage collector: it runs while nothing moves."""
        self._start_anew()
        self._heard = time.monotonic()
        self._silent = False
        self._active = True
        gc.disable()

    def deactivate(self) -> None:
        """Answer no more states."""
        self._active = False
        gc.enable()

    def cleanup(self) -> None:
        """Close the interfaces."""
        self.destroy_timer(self._watch)
        for service in self._services_made:
            self.destroy_service(service)
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        for publisher in self._outputs:
            self.destroy_lifecycle_publisher(publisher)

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Return how the controller keeps up."""
        status, pace = self._controller.status, self._pace
        figures = {
            "robot": self._robot.name,
            "model_hash": self._robot.model_hash,
            "phase": status.phase.name,
            "ticks": status.ticks,
            "missed_ticks": pace.missed_ticks,
            "saturated_ticks": status.saturated_ticks,
            "fallback_ticks": status.fallback_ticks,
            "tick_us_p99": pace.percentiles(99)[0] * MICRO,
        }
        if self._silent:
            return DiagnosticStatus.WARN, "no state arrives", figures
        if pace.missed_ticks > MISSED_SHARE_MAX * max(status.ticks, 1):
            return DiagnosticStatus.WARN, f"{pace.missed_ticks} states were missed", figures
        return DiagnosticStatus.OK, status.phase.name, figures

    def _start_anew(self) -> None:
        self._controller.reset()
        self._requests = Requests(self._controller)
        self._pace = Pace()
        self._last: Command | None = None

    def _restart(self) -> None:
        """Start anew; a request that runs has failed."""
        self._controller.stop()
        self._publish(self._requests.finish())
        self._start_anew()

    # --- the control loop --------------------------------------------------------------------------------------------

    def _on_state(self, data: bytes) -> None:
        received = time.perf_counter()
        if not self._active:
            return
        self._heard = time.monotonic()
        try:
            measurement = self._state_wire.read(data)
            _check_makes_sense(measurement)
        except ValueError as error:
            self.get_logger().error(f"a state is ignored: {error}", throttle_duration_sec=1.0)
            return
        if self._is_new(measurement):
            self._last = self._controller.step(measurement)
        self._commands.publish(self._command_wire.write(self._last))
        self._pace.tick_times.append(time.perf_counter() - received)
        self._publish(self._requests.finish())
        self._report(measurement)

    def _is_new(self, measurement: Measurement) -> bool:
        """Return whether a measurement is to be answered anew; count those before it that never came.

        One that comes again gets its answer again. One from the past means that the robot was reset.
        """
        if self._last is None:
            return True
        gap = measurement.sequence - self._last.state_sequence
        if gap < 0:
            self.get_logger().info("the robot was reset: starting anew", throttle_duration_sec=1.0)
            self._restart()
        elif gap > 1:
            self._pace.missed_ticks += gap - 1
        return gap != 0

    def _report(self, measurement: Measurement) -> None:
        if measurement.sequence % ODOMETRY_TICKS == 0:
            self._odometry.publish(odometry_to_message(self._controller.estimate))
        if measurement.sequence % STATUS_TICKS == 0:
            status = self._controller.status
            self._statuses.publish(status_to_message(status, self._pace, measurement.time, self._robot.name))

    def _watch_for_silence(self) -> None:
        silent = self._active and time.monotonic() - self._heard > SILENCE
        if silent and not self._silent:
            self.get_logger().warning("no state arrives: waiting for the robot")
        self._silent = silent
        if self._active and (silent or self._controller.settled):
            gc.collect(1)  # the young: a fraction of a millisecond, after start-up is frozen

    # --- requests ----------------------------------------------------------------------------------------------------

    def _on_plan(self, message: MotionPlan) -> None:
        if not self._active:
            return
        try:
            answers = self._requests.execute(plan_from_message(message, self._robot))
        except InvalidPlanError as error:
            wrong_robot = message.model_hash != self._robot.model_hash
            code = RefusalCode.WRONG_ROBOT if wrong_robot else RefusalCode.INVALID_PLAN
            refusal = RefusalError(code, str(error))
            answers = [Answer(message.request_id, message.motion, Outcome.REFUSED, refusal)]
        self._publish(answers)

    def _on_selection(self, message: MotionSelection) -> None:
        if self._active and message.motion in list(ControllerCommand):
            self._publish(self._requests.command(message.request_id, ControllerCommand(message.motion)))

    def _publish(self, answers: list[Answer]) -> None:
        stamp = to_stamp(0.0 if self._last is None else self._last.state_time)
        for answer in answers:
            if answer.refusal is not None:
                self.get_logger().warning(f"{answer.motion} {answer.outcome}: {answer.refusal.reason}")
            outcome = getattr(MotionResult, answer.outcome.name)
            self._results.publish(result_to_message(answer.request_id, answer.motion, outcome, stamp, answer.refusal))

    # --- services ----------------------------------------------------------------------------------------------------

    def _emergency_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._controller.stop()
        response.success, response.message = True, "stopped: joints are only damped until reset"
        return response

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._restart()
        response.success, response.message = True, "standing from the next state on"
        return response


def _check_makes_sense(measurement: Measurement) -> None:
    """Raise ValueError unless a measurement's numbers are finite and its quaternion is a rotation."""
    rows = [measurement.joint_position, measurement.joint_velocity, measurement.joint_torque]
    vectors = [measurement.orientation, measurement.angular_velocity, measurement.linear_acceleration]
    if measurement.localization is not None:
        vectors.append(measurement.localization)
    if not np.isfinite(np.concatenate((*rows, *vectors))).all():
        raise ValueError("expected finite numbers, found others")
    if abs(measurement.orientation @ measurement.orientation - 1.0) > QUATERNION_TOLERANCE:
        raise ValueError(f"field orientation: expected a unit quaternion, found {measurement.orientation.tolist()}")


def main() -> None:
    """Run the node until SIGINT or SIGTERM."""
    node.main(WbicNode)
