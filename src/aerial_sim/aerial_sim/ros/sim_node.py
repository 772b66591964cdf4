"""The simulated robot as a process: joint commands in, states out, at the robot's own pace or as fast as they come.

In real time a thread advances the simulation at absolute deadlines. In lock-step each command advances it by the period
it answers, and time also waits for the plan of a selection, so that a run can be repeated to the last bit.
"""

from __future__ import annotations

import threading
import time
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import String

from aerial_model.config import from_mapping, load_yaml
from aerial_model.robot.robot import Robot
from aerial_model.values.terrain import Terrain
from aerial_msgs.msg import GroundTruth, JointCommand, MotionResult, MotionSelection, RobotState
from aerial_ros import qos
from aerial_ros.latency import Latency
from aerial_ros.messages import to_stamp
from aerial_ros.node import AerialNode
from aerial_ros.node import main as run
from aerial_ros.wire import CommandWire, StateWire
from aerial_sim.exchange import Exchange
from aerial_sim.ros.messages import ground_truth_to_message, imu_to_message, joint_state_to_message
from aerial_sim.ros.pacer import Pacer
from aerial_sim.ros.selections import Selections
from aerial_sim.ros.services import Services
from aerial_sim.simulation import Simulation

TELEMETRY_PERIODS = 5  # control periods between two messages for people and tools
MISSED_SHARE_MAX = 0.005  # beyond it diagnostics warn
ROUND_TRIP_WINDOW = 64  # states whose answers are timed, however late
WATCH_PERIOD = 0.1  # wall time between two looks at what time waits for [s]
REPEAT_PERIOD = 0.5  # wall time after which an unanswered state is published again, while time stands still [s]
MICRO = 1e6  # microseconds in a second


class SimNode(AerialNode):
    """Stands in for the robot.

    Parameters: ``seed``, ``noise`` (nominal or off), ``terrain`` (YAML file of the boxes that are there from the start, in
    ``world``; empty: a flat floor), ``real_time`` (false: lock-step), ``ground_truth`` (whether to publish it), and those
    of every node.
    """

    def __init__(self, **options: object) -> None:
        super().__init__("sim", **options)
        self.declare_parameter("seed", 0)
        self.declare_parameter("noise", "nominal")
        self.declare_parameter("terrain", "")
        self.declare_parameter("real_time", True)
        self.declare_parameter("ground_truth", True)

    # --- life --------------------------------------------------------------------------------------------------------

    def configure(self) -> None:
        """Build the world, open the interfaces."""
        self._robot = Robot.load(self.get_parameter("robot").value)
        self._real_time: bool = self.get_parameter("real_time").value
        self._exchange = Exchange(self._simulation())
        self._selections = Selections(self._exchange, lock_step=not self._real_time)
        self._state_wire, self._command_wire = StateWire(self._robot), CommandWire(self._robot)
        self._lock = threading.RLock()  # guards the exchange: the pacing thread and the callbacks use it
        self._active = False
        self._next: bytes | None = None  # computed, but not due yet
        self._pacer: Pacer | None = None
        self._published_at = [0.0] * ROUND_TRIP_WINDOW  # of the last states, monotonic [s]
        self._round_trip = Latency()
        self._rejected_commands = 0
        self._open()

    def _simulation(self) -> Simulation:
        file = self.get_parameter("terrain").value
        terrain = from_mapping(Terrain, load_yaml(Path(file)), file) if file else Terrain()
        noise, seed = self.get_parameter("noise").value, self.get_parameter("seed").value
        return Simulation(self._robot, terrain=terrain, noise=noise, seed=seed)

    def activate(self) -> None:
        """Publish the first state; in real time, let the clock run."""
        self._description.publish(String(data=self._robot.description.text))
        self._active = True
        self._publish_state(self._state_wire.write(self._exchange.measurement))
        if self._real_time:
            self._pacer = Pacer(self._exchange.simulation.control_dt, self._on_period)

    def deactivate(self) -> None:
        """Stop the clock."""
        self._active = False
        if self._pacer is not None:
            self._pacer.stop()
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
            exchange = self._exchange
            figures: dict[str, object] = {
                "simulated_time_s": exchange.simulation.time,
                "rate_hz": 1 / exchange.simulation.control_dt,
                "ticks": exchange.ticks,
                "missed_ticks": exchange.missed_ticks,
                "late_ticks": 0 if self._pacer is None else self._pacer.late_ticks,
                "rejected_commands": self._rejected_commands,
                "round_trip_us_p50": self._round_trip.percentile(50) * MICRO,
                "round_trip_us_p99": self._round_trip.percentile(99) * MICRO,
                "round_trip_us_max": self._round_trip.percentile(100) * MICRO,
            }
        if not exchange.started:
            return DiagnosticStatus.WARN, "waiting for a first joint_command", figures
        if exchange.missed_ticks > MISSED_SHARE_MAX * exchange.ticks:
            return DiagnosticStatus.WARN, "too many ticks get no command in time", figures
        return DiagnosticStatus.OK, "paused" if exchange.paused else "running", figures

    def _open(self) -> None:
        control = qos.control(self._real_time)
        self._states = self.create_lifecycle_publisher(RobotState, "state", control)
        self._time = self.create_lifecycle_publisher(Clock, "/clock", qos.TELEMETRY)
        self._joint_states = self.create_lifecycle_publisher(JointState, "joint_states", qos.TELEMETRY)
        self._imu = self.create_lifecycle_publisher(Imu, "imu", qos.TELEMETRY)
        self._description = self.create_lifecycle_publisher(String, "robot_description", qos.LATCHED)
        self._truths = self.create_lifecycle_publisher(GroundTruth, "ground_truth", qos.RECORD)
        self._tells_truth = self.get_parameter("ground_truth").value
        self._publishers_made = [
            *(self._states, self._time, self._joint_states, self._imu, self._description, self._truths)
        ]
        self._subscriptions_made = [
            self.create_subscription(JointCommand, "joint_command", self._on_command, control, raw=True),
            self.create_subscription(MotionSelection, "motion_selection", self._on_selection, qos.EVENT),
            self.create_subscription(MotionResult, "motion_result", self._on_result, qos.EVENT),
        ]
        services = Services(self._exchange, self._selections, self._lock, go_on=self._go_on, restarted=self._on_restart)
        self._services_made = services.open(self)
        self._watch_timer = self.create_timer(WATCH_PERIOD, self._watch)

    # --- time --------------------------------------------------------------------------------------------------------

    def _on_period(self) -> None:
        """Publish the next state, in real time: it was computed as soon as the command for the one before was there.

        Physics and measurement thus take nothing of the time a command has.
        """
        with self._lock:
            if self._next is None and self._exchange.free:
                self._compute_next()  # without its command
            if self._next is not None:
                self._publish_next(self._next)

    def _go_on(self) -> None:
        """Compute the next state if the answer to the last is there and nothing holds time; in lock-step, publish it."""
        with self._lock:
            if self._active and self._next is None and self._exchange.free and self._exchange.answered:
                self._compute_next()
                if self._next is not None and not self._real_time:
                    self._publish_next(self._next)

    def _compute_next(self) -> None:
        self._next = self._state_wire.write(self._exchange.advance())

    def _publish_next(self, state: bytes) -> None:
        measurement = self._exchange.measurement
        self._publish_state(state)
        self._next = None
        if measurement.sequence % TELEMETRY_PERIODS == 0:
            self._time.publish(Clock(clock=to_stamp(measurement.time)))
            self._joint_states.publish(joint_state_to_message(measurement, self._robot))
            self._imu.publish(imu_to_message(measurement))
        if self._tells_truth:
            self._truths.publish(ground_truth_to_message(self._exchange.simulation.ground_truth(), self._robot))

    def _publish_state(self, message: bytes) -> None:
        self._states.publish(message)
        self._published_at[self._exchange.measurement.sequence % ROUND_TRIP_WINDOW] = time.monotonic()

    def _watch(self) -> None:
        """While time stands still, repeat a state nobody has answered, and do not wait for a plan for ever."""
        now = time.monotonic()
        with self._lock:
            exchange = self._exchange
            waits = not exchange.answered and (not self._real_time or not exchange.started)
            silence = now - self._published_at[exchange.measurement.sequence % ROUND_TRIP_WINDOW]
            if self._active and waits and silence > REPEAT_PERIOD:
                self._publish_state(self._state_wire.write(exchange.measurement))
            overdue = self._selections.overdue()
        if overdue is not None:
            self.get_logger().warning(f"selection '{overdue}' got no answer: time goes on")
            self._go_on()

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
            if 0 <= self._exchange.measurement.sequence - command.state_sequence < ROUND_TRIP_WINDOW:
                self._round_trip.add(received - self._published_at[command.state_sequence % ROUND_TRIP_WINDOW])
            self._exchange.offer(command)
        self._go_on()

    def _on_selection(self, message: MotionSelection) -> None:
        with self._lock:
            self._selections.on_selection(message)

    def _on_result(self, message: MotionResult) -> None:
        with self._lock:
            self._selections.on_result(message)
        self._go_on()

    def _on_restart(self) -> None:
        """Count anew and publish the first state again."""
        self._round_trip, self._rejected_commands, self._next = Latency(), 0, None
        if self._pacer is not None:
            self._pacer.late_ticks = 0
        self._publish_state(self._state_wire.write(self._exchange.measurement))


def main() -> None:
    """Run the node until SIGINT or SIGTERM."""
    run(SimNode)
