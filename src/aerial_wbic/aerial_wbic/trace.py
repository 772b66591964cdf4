"""What a tick of the controller saw, wanted and commanded, and how long its parts took."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from aerial_model.values.command import Command
from aerial_model.values.estimate import Estimate
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.stopwatch import Part
from aerial_wbic.target import PostureTarget, WholeBodyTarget


@dataclass(frozen=True, kw_only=True, eq=False)
class TickTrace:
    """What one tick saw, wanted and commanded; its arrays are copies, in W unless said otherwise.

    Without a whole-body target (the robot lies, or is stopped) there are no accelerations, forces and torques: None.
    """

    time: float  # of the measurement [s]
    sequence: int  # of the measurement
    phase: Phase
    behaviour: str  # name of the one that ran
    time_in_plan: float  # [s]; 0 without a plan
    request_id: str  # of the plan that is carried out, or empty
    estimate: Estimate
    contact: np.ndarray  # (n_c,) bool, the points that carry load by the schedule
    target: WholeBodyTarget | PostureTarget | None
    vdot_cmd: np.ndarray | None  # q̈_cmd of the tasks (nv,) [m/s², rad/s²]
    v_ref: np.ndarray | None  # q̇_ref of the tasks (nv,) [m/s, rad/s]
    force: np.ndarray | None  # f_r of the solution (n_c, 3) [N]
    joint_torque: np.ndarray | None  # of the solution, before friction (n,) [N·m]
    command: Command
    saturated: bool  # a torque beyond a limit was asked for
    fallback: bool  # the forces are the fallback's
    durations: Mapping[Part, float] = field(default_factory=dict)  # of the tick's parts [s]; empty without a clock
