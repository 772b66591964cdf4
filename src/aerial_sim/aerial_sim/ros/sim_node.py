"""The robot's stand-in as a process: joint commands in, states out, at the robot's own pace or as fast as they come.

In real time a thread advances the simulation at absolute deadlines. In lock-step each command advances it by the period
it answers, and time also waits for the plan of a selection, so that a run can be repeated to the last bit.
"""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool

from aerial_model.errors import ConfigurationError, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import ControllerCommand
from aerial_msgs.msg import GroundTruth, JointCommand, MotionResult, MotionSelection, RobotState
from aerial_msgs.srv import Disturb, Reset, Step
from aerial_ros import qos
from aerial_ros.messages import selection_from_message, to_stamp
from aerial_ros.node import AerialNode
from aerial_ros.node import main as run
from aerial_ros.wire import CommandWire, StateWire
from aerial_sim.robot_side.round_trip import Latency
from aerial_sim.robot_side.session import Session
from aerial_sim.ros.messages import ground_truth_to_message, imu_to_message, joint_state_to_message
from aerial_sim.simulation import Simulation
from aerial_sim.world.placement import placed_ahead

TELEMETRY_PERIODS = 5  # control periods between two messages for people and tools
LATE = 0.25  # of a period, by which a tick may begin behind its time and the next still keep to theirs
MISSED_SHARE_MAX = 0.005  # beyond it diagnostics warn
ROUND_TRIP_WINDOW = 64  # states whose answers are timed, however late
WATCH_PERIOD = 0.1  # wall time between two looks at what time waits for [s]
REPEAT_PERIOD = 0.5  # wall time after which an unanswered state is published again, while time stands still [s]
PLAN_TIMEOUT = 10.0  # wall time for which lock-step waits for the answer to a selection … [s]
START_TIMEOUT = 8.0  # … and, once it is planned, for the controller's [s]
MICRO = 1e6  # microseconds in a second
_FINAL = (MotionResult.REFUSED, MotionResult.LANDED, MotionResult.FAILED, MotionResult.ABORTED)


class SimNode(AerialNode):
    """Stands in for the robot.

    Parameters: ``seed``, ``noise`` (nominal or off), ``real_time`` (false: lock-step), ``ground_truth`` (whether to
    publish it), and those of every node.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("sim", **options)
        self.declare_parameter("seed", 0)
        self.declare_parameter("noise", "nominal")
        self.declare_parameter("real_time", True)
        self.declare_parameter("ground_truth", True)

    # --- life --------------------------------------------------------------------------------------------------------

    def configure(self) -> None:
        """Build the world, open the interfaces."""
        self._robot = Robot.load(self._parameter("robot"))
        simulation = Simulation(self._robot, noise=self._parameter("noise"), seed=self._parameter("seed"))
        self._session = Session(simulation)
        self._state_wire, self._command_wire = StateWire(self._robot), CommandWire(self._robot)
        self._lock = threading.RLock()  # guards the session: the pacing thread and the callbacks use it
        self._real_time: bool = self._parameter("real_time")
        self._active = False
        self._next: bytes | None = None  # computed, but not due yet
        self._moving: str | None = None  # request whose motion runs: no time to rebuild the terrain
        self._refused: str | None = None  # request last refused: time need not wait for it
        self._pacer: threading.Thread | None = None
        self._published_at = [0.0] * ROUND_TRIP_WINDOW  # of the last states, monotonic [s]
        self._wait_until = 0.0  # when lock-step stops waiting for a plan, monotonic [s]
        self._round_trip = Latency()
        self._late_ticks = 0
        self._rejected_commands = 0
        self._open()

    def activate(self) -> None:
        """Publish the first state; in real time, let the clock run."""
        self._description.publish(String(data=self._robot.description.text))
        self._active = True
        self._publish_state(self._state_wire.write(self._session.measurement))
        if self._real_time:
            self._pacer = threading.Thread(target=self._pace, name="pace", daemon=True)
            self._pacer.start()

    def deactivate(self) -> None:
        """Stop the clock."""
        self._active = False
        if self._pacer is not None:
            self._pacer.join()
            self._pacer = None

    def cleanup(self) -> None:
        """Close the interfaces."""
        self.destroy_timer(self._watch_timer)
        for service in self._services_made:
            self.destroy_service(service)
        for subscription in self._subscriptions_made:
            self.destroy_subscription(subscription)
        for publisher in self._publishers_made:
            self.destroy_lifecycle_publisher(publisher)

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Return how well the control loop has kept up since the last reset."""
        with self._lock:
            session = self._session
            figures = {
                "simulated_time_s": session.simulation.time,
                "rate_hz": 1 / session.simulation.control_dt,
                "ticks": session.ticks,
                "missed_ticks": session.missed_ticks,
                "late_ticks": self._late_ticks,
                "rejected_commands": self._rejected_commands,
                "round_trip_us_p50": self._round_trip.percentile(50) * MICRO,
                "round_trip_us_p99": self._round_trip.percentile(99) * MICRO,
                "round_trip_us_max": self._round_trip.percentile(100) * MICRO,
            }
        if not session.started:
            return DiagnosticStatus.WARN, "waiting for a first joint_command", figures
        if session.missed_ticks > MISSED_SHARE_MAX * session.ticks:
            return DiagnosticStatus.WARN, "too many ticks get no command in time", figures
        return DiagnosticStatus.OK, "paused" if session.paused else "running", figures

    def _open(self) -> None:
        control = qos.control(self._real_time)
        self._states = self.create_lifecycle_publisher(RobotState, "state", control)
        self._time = self.create_lifecycle_publisher(Clock, "/clock", qos.TELEMETRY)
        self._joint_states = self.create_lifecycle_publisher(JointState, "joint_states", qos.TELEMETRY)
        self._imu = self.create_lifecycle_publisher(Imu, "imu", qos.TELEMETRY)
        self._description = self.create_lifecycle_publisher(String, "robot_description", qos.LATCHED)
        self._truths = self.create_lifecycle_publisher(GroundTruth, "ground_truth", qos.RECORD)
        self._tells_truth = self._parameter("ground_truth")
        self._publishers_made = [
            *(self._states, self._time, self._joint_states, self._imu, self._description, self._truths)
        ]
        self._subscriptions_made = [
            self.create_subscription(JointCommand, "joint_command", self._on_command, control, raw=True),
            self.create_subscription(MotionSelection, "motion_selection", self._on_selection, qos.EVENT),
            self.create_subscription(MotionResult, "motion_result", self._on_result, qos.EVENT),
        ]
        self._services_made = [
            self.create_service(Reset, "~/reset", self._reset),
            self.create_service(SetBool, "~/pause", self._pause),
            self.create_service(Step, "~/step", self._step),
            self.create_service(Disturb, "~/disturb", self._disturb),
        ]
        self._watch_timer = self.create_timer(WATCH_PERIOD, self._watch)

    # --- time --------------------------------------------------------------------------------------------------------

    def _pace(self) -> None:
        """Publish states at absolute deadlines, each computed as soon as the command for the one before was there.

        Physics and measurement thus take nothing of the time a command has. A state that came out late shifts what
        follows: the controller has its period, counted from the state, whatever the machine does to this thread.
        """
        period = self._session.simulation.control_dt
        deadline = time.monotonic()
        while self._active:
            deadline += period
            spare = deadline - time.monotonic()
            if spare > 0:
                time.sleep(spare)
            now = time.monotonic()
            if now - deadline > LATE * period:
                self._late_ticks += 1
                deadline = now
            with self._lock:
                if self._next is None and self._session.free:
                    self._compute_next()  # without its command
                if self._next is not None:
                    self._publish_next()

    def _go_on(self) -> None:
        """Compute the next state if the answer to the last is there and nothing holds time; in lock-step, publish it."""
        with self._lock:
            if self._active and self._next is None and self._session.free and self._session.answered:
                self._compute_next()
                if not self._real_time:
                    self._publish_next()

    def _compute_next(self) -> None:
        self._next = self._state_wire.write(self._session.advance())

    def _publish_next(self) -> None:
        measurement = self._session.measurement
        self._publish_state(self._next)
        self._next = None
        if measurement.sequence % TELEMETRY_PERIODS == 0:
            self._time.publish(Clock(clock=to_stamp(measurement.time)))
            self._joint_states.publish(joint_state_to_message(measurement, self._robot))
            self._imu.publish(imu_to_message(measurement))
        if self._tells_truth:
            self._truths.publish(ground_truth_to_message(self._session.simulation.ground_truth(), self._robot))

    def _publish_state(self, message: bytes) -> None:
        self._states.publish(message)
        self._published_at[self._session.measurement.sequence % ROUND_TRIP_WINDOW] = time.monotonic()

    def _watch(self) -> None:
        """While time stands still, repeat a state nobody has answered, and do not wait for a plan for ever."""
        now = time.monotonic()
        with self._lock:
            session = self._session
            waits = not session.answered and (not self._real_time or not session.started)
            silence = now - self._published_at[session.measurement.sequence % ROUND_TRIP_WINDOW]
            if self._active and waits and silence > REPEAT_PERIOD:
                self._publish_state(self._state_wire.write(session.measurement))
            if session.awaited is not None and now > self._wait_until:
                self.get_logger().warning(f"selection '{session.awaited}' got no answer: time goes on")
                self._end_wait()

    # --- inputs ------------------------------------------------------------------------------------------------------

    def _on_command(self, data: bytes) -> None:
        try:
            command = self._command_wire.read(data)
        except ValueError as error:
            self._rejected_commands += 1
            self.get_logger().error(f"a command is ignored: {error}", throttle_duration_sec=1.0)
            return
        received = time.monotonic()
        with self._lock:
            if 0 <= self._session.measurement.sequence - command.state_sequence < ROUND_TRIP_WINDOW:
                self._round_trip.add(received - self._published_at[command.state_sequence % ROUND_TRIP_WINDOW])
            self._session.offer(command)
        self._go_on()

    def _on_selection(self, message: MotionSelection) -> None:
        """Put the selected terrain ahead of the robot; in lock-step, hold time until the plan is there."""
        if self._moving is not None or message.motion in list(ControllerCommand):
            return
        try:
            request = selection_from_message(message)
        except RefusalError:
            return  # the planner says why
        with self._lock:
            simulation = self._session.simulation
            q, _ = simulation.state()
            terrain = placed_ahead(self._robot, q, simulation.terrain, request.terrain)
            if terrain.boxes or simulation.terrain.boxes:
                simulation.set_terrain(terrain)
            if not self._real_time and request.request_id != self._refused:
                self._session.awaited = request.request_id
                self._wait_until = time.monotonic() + PLAN_TIMEOUT

    def _on_result(self, message: MotionResult) -> None:
        if message.outcome == MotionResult.STARTED:
            self._moving = message.request_id
        elif message.outcome in _FINAL and message.request_id == self._moving:
            self._moving = None
        elif message.outcome == MotionResult.REFUSED:
            self._refused = message.request_id  # the answer may outrun the selection
        with self._lock:
            if message.request_id != self._session.awaited:
                return
            if message.outcome == MotionResult.PLANNED:
                self._wait_until = time.monotonic() + START_TIMEOUT  # for the controller to have the plan as well
            else:
                self._end_wait()

    def _end_wait(self) -> None:
        self._session.awaited = None
        self._go_on()

    # --- services ----------------------------------------------------------------------------------------------------

    def _reset(self, request: Reset.Request, response: Reset.Response) -> Reset.Response:
        with self._lock:
            self._session.reset(request.seed)
            self._round_trip, self._late_ticks, self._rejected_commands = Latency(), 0, 0
            self._moving = self._next = None
            self._publish_state(self._state_wire.write(self._session.measurement))
        response.success = True
        return response

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        with self._lock:
            self._session.paused = request.data
        self._go_on()
        response.success = True
        return response

    def _step(self, request: Step.Request, response: Step.Response) -> Step.Response:
        """Grant a paused simulation some periods; the answer's stamp is the time at which it will stand again."""
        with self._lock:
            session, simulation = self._session, self._session.simulation
            if not session.paused:
                response.message = "the simulation is not paused"
            elif not session.started:
                response.message = "no joint_command has come yet"
            else:
                session.granted += request.count
                response.success = True
            response.stamp = to_stamp(simulation.time + session.granted * simulation.control_dt)
        self._go_on()
        return response

    def _disturb(self, request: Disturb.Request, response: Disturb.Response) -> Disturb.Response:
        response.message = _why_no_disturbance(request)
        if not response.message:
            try:
                with self._lock:
                    self._session.simulation.disturb(
                        np.array(request.force) if request.duration > 0 else None,
                        request.duration,
                        added_mass=request.added_mass if request.has_added_mass else None,
                        friction_coefficient=request.friction_coefficient if request.has_friction_coefficient else None,
                    )
            except ConfigurationError as error:
                response.message = str(error)
        response.success = not response.message
        return response

    def _parameter(self, name: str) -> Any:
        return self.get_parameter(name).value


def _why_no_disturbance(request: Disturb.Request) -> str:
    numbers = [*request.force, request.duration, request.added_mass, request.friction_coefficient]
    if not np.isfinite(numbers).all():
        return "expected finite numbers"
    if request.duration < 0 or request.friction_coefficient < 0:
        return "duration and friction coefficient must not be negative"
    return ""


def main() -> None:
    """Run the node until SIGINT or SIGTERM."""
    run(SimNode)
