"""The planner as a process: a selection in, a plan and an answer out; previews on the side.

Every selection gets an answer, whatever it holds, and nothing it holds ends the node.
"""

from __future__ import annotations

import threading
import time
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from sensor_msgs.msg import JointState

from aerial_model.errors import AerialError, RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.estimate import Estimate
from aerial_model.values.request import ControllerCommand, MotionRequest
from aerial_msgs.action import PlanMotion
from aerial_msgs.msg import MotionPlan, MotionResult, MotionSelection
from aerial_planner.assembly.library import PlanLibrary
from aerial_planner.codegen.library import default_cache
from aerial_planner.motion.motion import known_motions
from aerial_planner.ocp.options import SolverName
from aerial_planner.planner import Planner
from aerial_planner.ros.unanswered import UnansweredPlan
from aerial_planner.ros.worker import Worker
from aerial_ros import node, qos
from aerial_ros.messages import (
    code_to_message,
    estimate_from_messages,
    plan_to_message,
    result_to_message,
    selection_from_message,
)

REPEAT_PERIOD = 0.5  # from one publication of a plan that no controller has answered to the next [s]
REPEAT_TIME = 8.0  # for which it is repeated: on a busy machine, nodes that have just started find each other late [s]


class _CancelledError(Exception):
    """The client of a preview does not want it any more."""


class PlannerNode(node.AerialNode):
    """Plans what is selected, from where the robot is believed to stand.

    Parameters: ``solver`` (riccati, fatrop or ipopt), ``niceness`` of the planning thread (0 to 19), ``warm_up`` (motions whose
    problems are built on activation: names separated by commas, or ``all``), ``library`` (folder of plans to start from
    and to add to; empty: none), and those of every node.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("planner", **options)
        self.declare_parameter("solver", SolverName.RICCATI.value)
        self.declare_parameter("niceness", 5)
        self.declare_parameter("warm_up", "all")
        self.declare_parameter("library", "")

    def configure(self) -> None:
        """Load the robot, make the planner, open the interfaces."""
        self._robot = Robot.load(self.get_parameter("robot").value)
        folder = self.get_parameter("library").value
        self._planner = Planner(
            self._robot,
            solver=self.get_parameter("solver").value,
            cache=default_cache(),
            plans=PlanLibrary(Path(folder), self._robot, self.get_logger().warning) if folder else None,
        )
        self._worker = Worker(self.get_parameter("niceness").value, self.get_logger())
        self._active = False
        self._odometry: Odometry | None = None
        self._joints: JointState | None = None
        self._counts = {"planned": 0, "refused": 0}  # by the planning thread, or by the node's if it is busy
        self._counting = threading.Lock()
        self._plans = self.create_lifecycle_publisher(MotionPlan, "motion_plan", qos.EVENT)
        self._results = self.create_lifecycle_publisher(MotionResult, "motion_result", qos.ANSWER)
        self._unanswered = UnansweredPlan()
        self._repeater = self.create_timer(REPEAT_PERIOD, self._repeat)
        self._inputs = [
            self.create_subscription(MotionResult, "motion_result", self._unanswered.answered, qos.EVENT),
            self.create_subscription(MotionSelection, "motion_selection", self._on_selection, qos.EVENT),
            self.create_subscription(Odometry, "odometry", partial(setattr, self, "_odometry"), qos.TELEMETRY),
            self.create_subscription(JointState, "joint_states", partial(setattr, self, "_joints"), qos.TELEMETRY),
        ]
        # A goal is executed, in ROS's sense, when its plan is there; until then the worker has it and the node listens.
        self._previews = ActionServer(
            self,
            PlanMotion,
            "plan_motion",
            execute_callback=lambda goal: PlanMotion.Result(),
            handle_accepted_callback=self._on_preview,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
        )

    def activate(self) -> None:
        """Take selections from now on; build the problems of motions meanwhile."""
        self._active = True
        asked = self.get_parameter("warm_up").value
        self._prepare(
            list(known_motions(self._robot)) if asked == "all" else [name for name in asked.split(",") if name]
        )

    def deactivate(self) -> None:
        """Take no more selections."""
        self._active = False

    def cleanup(self) -> None:
        """Finish the plan that is being made, then close the interfaces."""
        self._worker.shutdown()
        self.destroy_timer(self._repeater)
        self._previews.destroy()
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        for publisher in (self._plans, self._results):
            self.destroy_lifecycle_publisher(publisher)

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Return what the planner is at, and what it did so far."""
        with self._counting:
            figures = {"robot": self._robot.name, "model_hash": self._robot.model_hash, **self._counts}
        return DiagnosticStatus.OK, self._worker.activity, figures

    def _on_selection(self, selection: MotionSelection) -> None:
        if not self._active or selection.motion in list(ControllerCommand):
            return
        self._worker.serve(
            f"planning {selection.motion} {selection.request_id}",
            partial(self._plan, selection, self._start()),
            partial(self._answer, selection, MotionResult.REFUSED),
        )

    def _on_preview(self, goal: ServerGoalHandle) -> None:
        self._worker.serve(
            f"previewing {goal.request.selection.motion}",
            partial(self._plan_preview, goal, self._start()),
            lambda refusal: goal.execute(partial(_refused_preview, refusal)),
        )

    def _prepare(self, motions: list[str]) -> None:
        """Build the problems of motions, one after the other; a request that comes meanwhile is served in between."""
        if motions:
            self._worker.prepare(f"warming up for {', '.join(motions)}", partial(self._warm_up, *motions))
        else:
            self.get_logger().info(f"ready to plan for {self._robot.name}: {', '.join(known_motions(self._robot))}")

    def _warm_up(self, motion: str, *others: str) -> None:
        try:
            self._planner.warm_up(MotionRequest(motion=motion))
        except AerialError as error:
            self.get_logger().warning(f"cannot prepare {motion}: {error}")
        self._prepare(list(others))

    def _plan(self, selection: MotionSelection, start: Estimate | None) -> None:
        result = self._planner.plan(selection_from_message(selection), start)
        self._answer(selection, MotionResult.PLANNED)
        message = plan_to_message(result.plan, self._robot)
        self._unanswered.put(message, time.monotonic() + REPEAT_TIME)
        self._plans.publish(message)

    def _repeat(self) -> None:
        """Publish the last plan again while no controller has answered it: it may not have been found when it came."""
        plan = self._unanswered.at(time.monotonic())
        if plan is not None and self._active:
            self._plans.publish(plan)

    def _answer(self, selection: MotionSelection, outcome: int, refusal: RefusalError | None = None) -> None:
        with self._counting:
            self._counts["planned" if refusal is None else "refused"] += 1
        stamp = self.get_clock().now().to_msg()
        self._results.publish(result_to_message(selection.request_id, selection.motion, outcome, stamp, refusal))

    def _plan_preview(self, goal: ServerGoalHandle, start: Estimate | None) -> None:
        def progress(stage: str, iteration: int, residual: float) -> None:
            if goal.is_cancel_requested:
                raise _CancelledError
            goal.publish_feedback(PlanMotion.Feedback(stage=stage, iteration=int(iteration), residual=float(residual)))

        try:
            result = self._planner.plan(selection_from_message(goal.request.selection), start, progress)
        except _CancelledError:
            goal.execute(_cancelled_preview)
        else:
            goal.execute(partial(_finished_preview, plan_to_message(result.plan, self._robot)))

    def _start(self) -> Estimate | None:
        """Return the freshest estimate; None before there is one."""
        if self._odometry is None or self._joints is None:
            return None
        return estimate_from_messages(self._odometry, self._joints, self._robot)


def _finished_preview(plan: MotionPlan, goal: ServerGoalHandle) -> PlanMotion.Result:
    goal.succeed()
    return PlanMotion.Result(success=True, plan=plan)


def _cancelled_preview(goal: ServerGoalHandle) -> PlanMotion.Result:
    goal.canceled()
    return PlanMotion.Result()


def _refused_preview(refusal: RefusalError, goal: ServerGoalHandle) -> PlanMotion.Result:
    goal.abort()
    return PlanMotion.Result(code=code_to_message(refusal.code), reason=refusal.reason)


def main() -> None:
    """Run the node until SIGINT or SIGTERM."""
    node.main(PlannerNode)
