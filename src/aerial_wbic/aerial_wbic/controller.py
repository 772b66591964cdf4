"""The whole-body controller: a measurement in, a command out, 500 times a second.

    supervisor → estimator → behaviour's target → tasks → hierarchy → qp → joint command

Without a plan the robot stands. A plan is followed from take-off through flight to its landing time; then the robot
comes to rest over its feet and stands again, ready for the next. What else it can do, and what may follow what, says
``behaviours.supervisor``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.kinematics import Configuration, Kinematics
from aerial_model.robot.posture import crouch_depth
from aerial_model.robot.robot import BASE_ORIENTATION, BASE_POSITION, GRAVITY, JOINT_POSITION, Robot
from aerial_model.timing import CONTROL_PERIOD
from aerial_model.values.command import Command
from aerial_model.values.estimate import Estimate
from aerial_model.values.frame import StartFrame
from aerial_model.values.measurement import Measurement
from aerial_model.values.plan import Plan, Track
from aerial_wbic.behaviours.acceptance import check_start
from aerial_wbic.behaviours.behaviour import Behaviour, Event, Setting
from aerial_wbic.behaviours.follow_plan import PlanTarget
from aerial_wbic.behaviours.lie import FoldTarget
from aerial_wbic.behaviours.phase import FOLLOWING, Phase
from aerial_wbic.behaviours.supervisor import Supervisor
from aerial_wbic.estimation.estimator import Estimator
from aerial_wbic.estimation.touchdown import ContactSense
from aerial_wbic.force_qp.optimization import ForceOptimization, Solution
from aerial_wbic.force_qp.solvers import SOLVERS
from aerial_wbic.gains import ControllerGains, Touchdown
from aerial_wbic.joint_command import JointCommands
from aerial_wbic.stopwatch import Clock, Part, Stopwatch
from aerial_wbic.target import PostureTarget, WholeBodyTarget, copied_target
from aerial_wbic.tasks.limbs import Limbs
from aerial_wbic.tasks.ordering import task_ordering
from aerial_wbic.tasks.tasks import attitude_error, command
from aerial_wbic.trace import TickTrace

_DEPTH_SHARE = 0.85  # of the depth to which legs can bend that a landing may use


@dataclass(frozen=True, kw_only=True, eq=False)
class ControllerStatus:
    """How the controller is doing; errors are plan minus estimate in the start heading frame, zero without a plan."""

    phase: Phase
    time_in_plan: float  # [s]
    request_id: str  # of the plan that runs, or empty
    ticks: int  # measurements answered
    saturated_ticks: int  # of these, with a torque beyond a limit
    fallback_ticks: int  # of these, with the fallback's forces
    com_error: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) [m]
    com_velocity_error: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) [m/s]
    orientation_error: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) rotation vector [rad]
    angular_momentum_error: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) [kg·m²/s]


class _Tick(NamedTuple):
    """What a trace is made from, should someone ask: references to what the next tick overwrites."""

    measurement: Measurement
    behaviour: Behaviour
    state: Configuration
    target: WholeBodyTarget | PostureTarget | None
    command: Command
    vdot_cmd: np.ndarray | None = None
    v_ref: np.ndarray | None = None
    solution: Solution | None = None
    saturated: bool = False


class Controller:
    """One robot's controller.

    Args:
        robot: with a section ``controller`` in its ``robot.yaml``.
        clock: by which ``trace`` tells how long a tick's parts took; None: it does not.

    Raises:
        ConfigurationError: for a missing or misspelt gain.
    """

    def __init__(self, robot: Robot, clock: Clock | None = None) -> None:
        self.robot = robot
        self._gains = gains = _within_reach(robot.section("controller", ControllerGains), robot)
        self._limbs = Limbs(robot)
        self._ordering = task_ordering(gains)
        self._stopwatch = Stopwatch(clock)
        self._qp = ForceOptimization(robot, gains.weight_base, gains.weight_force, SOLVERS[gains.qp_solver])
        self._estimator = Estimator(robot, gains.estimator, self._stopwatch)
        self._sense = ContactSense(robot, gains.touchdown_sensing, gains.stiction_speed)
        self._supervisor = Supervisor(Setting(robot=robot, gains=gains, home_height=_home_height(robot)))
        self.reset()
        self._rehearse()
        self.reset()

    def reset(self) -> None:
        """Forget estimate, plan, stop and counters; stand from the next measurement on."""
        self._estimator.reset()
        self._sense.forget()
        self._supervisor.reset()
        self._touching = np.zeros(self.robot.n_contacts, dtype=bool)  # points felt to bear load in the last flight tick
        self._joint_commands = JointCommands(self.robot, self._gains)
        self._last: _Tick | None = None
        self._start_frame = StartFrame()  # of the plan that was accepted last
        self.estimate: Estimate | None = None  # in the odom frame; None before the first measurement
        self._ticks = self._fallback_ticks = 0

    def step(self, measurement: Measurement) -> Command:
        """Return the answer to a measurement."""
        self._stopwatch.start()
        self._ticks += 1
        self._supervisor.advance(measurement.time, self._touching)
        self.estimate = self._estimator.update(measurement, self._supervisor.contact)
        state = self._estimator.state
        self._stopwatch.lap(Part.ESTIMATE)
        self._detect_touchdown(state, measurement)
        self._supervisor.observe(state)
        target = self._supervisor.target(state)
        self._stopwatch.lap(Part.TARGET)
        if isinstance(target, WholeBodyTarget):
            return self._balance(measurement, state, target)
        command = self._joint_commands.resting(target, measurement)
        self._stopwatch.lap(Part.TORQUE)
        self._last = _Tick(measurement, self._supervisor.behaviour, state, target, command)
        return command

    def _balance(self, measurement: Measurement, state: Configuration, target: WholeBodyTarget) -> Command:
        """Return the command that moves the whole body as the target asks, by forces that the ground can give."""
        saturated_before = self._joint_commands.saturated_ticks
        vdot_cmd, v_ref = self._accelerations(state, target)
        self._stopwatch.lap(Part.HIERARCHY)
        desired = state, vdot_cmd, target.force, target.contact
        solution = self._qp.solve(*desired)
        self._fallback_ticks += not solution.solved
        self._stopwatch.lap(Part.QP)
        if np.count_nonzero(target.contact) and self._joint_commands.exceeds(solution.torque, v_ref, measurement):
            headroom = self._joint_commands.headroom(v_ref, measurement)
            self._stopwatch.lap(Part.TORQUE)
            solution = self._qp.within(headroom, solution, *desired)
            self._stopwatch.lap(Part.QP)
        command = self._joint_commands.command(solution.torque, v_ref, measurement)
        self._stopwatch.lap(Part.TORQUE)
        saturated = self._joint_commands.saturated_ticks > saturated_before
        self._last = _Tick(
            measurement, self._supervisor.behaviour, state, target, command, vdot_cmd, v_ref, solution, saturated
        )
        return command

    def accept(self, plan: Plan) -> None:
        """Begin ``plan``, given in the start heading frame of its loaded points, with the next measurement.

        Raises:
            InvalidPlanError: if it is inconsistent, not finite or for another robot.
            RefusalError: if a plan runs, the robot does not stand, or where it is and how it moves is not how the plan begins.
        """
        plan.checked(self.robot)
        self._supervisor.check(Event.PLAN_ACCEPTED)
        if self.estimate is None:
            raise RefusalError(RefusalCode.NOT_STANDING, "the robot does not stand yet: no measurement has come")
        check_start(plan, self.estimate, self.robot, self._gains)
        self._start_frame = StartFrame.of(self.robot, self.estimate.q, plan.contact[0])
        self._supervisor.ask(Event.PLAN_ACCEPTED, plan.placed(self._start_frame))

    def abort(self) -> None:
        """Call off the motion that runs and come to rest, as long as every foot is on the ground.

        Raises:
            RefusalError: if no motion runs or a foot has left the ground.
        """
        self._supervisor.ask(Event.ABORT)

    def lie_down(self) -> None:
        """Sink to the ground and let the joints go.

        Raises:
            RefusalError: if the robot does not stand.
        """
        self._supervisor.ask(Event.LIE_DOWN)

    def stand_up(self) -> None:
        """Fold the legs under the body and rise.

        Raises:
            RefusalError: if the robot does not lie, or lies too far on its side.
        """
        self._supervisor.ask(Event.STAND_UP)

    def stop(self) -> None:
        """Emergency stop: joints are only damped until ``reset``."""
        self._supervisor.ask(Event.STOP)

    @property
    def phase(self) -> Phase:
        """What the controller is doing."""
        return self._supervisor.phase

    @property
    def settled(self) -> bool:
        """Whether nothing is under way: the robot stands, lies, or is stopped."""
        return self._supervisor.behaviour.settled

    @property
    def status(self) -> ControllerStatus:
        """How the controller is doing, as of the last tick."""
        run = self._supervisor.plan_run
        return ControllerStatus(
            phase=self.phase,
            time_in_plan=self._supervisor.time_in_plan,
            request_id="" if run is None else run.plan.request_id,
            ticks=self._ticks,
            saturated_ticks=self._joint_commands.saturated_ticks,
            fallback_ticks=self._fallback_ticks,
            **(self._errors() if self.phase in FOLLOWING else {}),
        )

    @property
    def trace(self) -> TickTrace:
        """What the last tick saw, wanted and commanded.

        Raises:
            RuntimeError: before the first tick.
        """
        tick, estimate = self._last, self.estimate
        if tick is None or estimate is None:
            raise RuntimeError("there is no trace before the first measurement")
        time, behaviour = tick.measurement.time, tick.behaviour
        run = behaviour.plan_run
        return TickTrace(
            time=time,
            sequence=tick.measurement.sequence,
            phase=behaviour.phase(time),
            behaviour=behaviour.name,
            time_in_plan=0.0 if run is None else run.time(time),
            request_id="" if run is None else run.plan.request_id,
            estimate=estimate,
            contact=behaviour.contact(time).copy(),
            target=copied_target(tick.target),
            vdot_cmd=tick.vdot_cmd,
            v_ref=tick.v_ref,
            force=None if tick.solution is None else tick.solution.force.copy(),
            joint_torque=None if tick.solution is None else tick.solution.torque.copy(),
            command=tick.command,
            saturated=tick.saturated,
            fallback=tick.solution is not None and not tick.solution.solved,
            durations=dict(self._stopwatch.durations),
        )

    def _detect_touchdown(self, state: Configuration, measurement: Measurement) -> None:
        """Feel for the ground in flight, if that is to end it."""
        if self._gains.touchdown is Touchdown.TIME:
            return
        if self.phase is Phase.FLIGHT:
            self._touching = self._sense.update(measurement.time, state, measurement.joint_torque)
        else:
            self._sense.forget()

    def _accelerations(self, state: Configuration, target: WholeBodyTarget) -> tuple[np.ndarray, np.ndarray]:
        """Return q̈_cmd and q̇_ref ``(nv,)`` of the tasks."""
        vdot, v_ref = np.empty(len(state.v)), np.empty(len(state.v))
        command(state.block, target.block, self._limbs.joints(target.contact).block, self._ordering.block, vdot, v_ref)
        return vdot, v_ref

    def _rehearse(self) -> None:
        """Stand for two ticks, once without torque to spare, report and begin to fold the legs: all is compiled then."""
        q = self.robot.standing_configuration()
        still, joints = np.zeros(3), np.zeros(self.robot.n_joints)
        for tick in range(2):
            measurement = Measurement(
                time=CONTROL_PERIOD * tick,
                sequence=tick,
                orientation=q[BASE_ORIENTATION].copy(),
                angular_velocity=still,
                linear_acceleration=np.array([0.0, 0.0, GRAVITY]),
                joint_position=q[JOINT_POSITION].copy(),
                joint_velocity=joints,
                joint_torque=joints,
                localization=q[BASE_POSITION].copy(),
            )
            self.step(measurement)
        last = self._last
        if last is None or not isinstance(last.target, WholeBodyTarget):
            raise RuntimeError("a controller that was reset does not stand")
        state, target = last.state, last.target
        desired = state, np.zeros(self.robot.model.nv), target.force, target.contact
        self._qp.within(self._joint_commands.headroom(state.v, measurement), self._qp.solve(*desired), *desired)
        attitude_error(target.body.orientation, state.base_orientation)
        for time in (0.0, CONTROL_PERIOD):
            self._sense.update(time, state, joints)
        FoldTarget(state, 0.0, rate=1.0, pose=joints).at(0.0)
        PlanTarget(Track.still(self.robot.n_joints, self.robot.n_contacts), self._gains.follow).at(0.0)

    def _errors(self) -> dict[str, np.ndarray]:
        """Return how far the last tick was off its plan; nothing before the plan began."""
        last = self._last
        if last is None or not isinstance(last.target, WholeBodyTarget) or self._supervisor.time_in_plan <= 0:
            return {}
        state, target = last.state, last.target
        R_SW = self._start_frame.R_SW
        return {
            "com_error": R_SW @ (target.body.com - state.com),
            "com_velocity_error": R_SW @ (target.body.com_velocity - state.com_velocity),
            "orientation_error": R_SW @ attitude_error(target.body.orientation, state.base_orientation),
            "angular_momentum_error": R_SW @ (target.angular_momentum - state.angular_momentum),
        }


def _within_reach(gains: ControllerGains, robot: Robot) -> ControllerGains:
    """Return the gains with a landing depth that the legs can bend to, feet flat."""
    depth = _DEPTH_SHARE * crouch_depth(robot, robot.poses["landing"])
    return replace(gains, landing_depth=min(gains.landing_depth, depth))


def _home_height(robot: Robot) -> float:
    """Return the height of the centre of mass above the ground in the home pose [m]."""
    state = Kinematics(robot).at(robot.standing_configuration("home"), np.zeros(robot.model.nv))
    return float(state.com[2])
