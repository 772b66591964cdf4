"""To lie: sink to the ground, let the joints go, and fold the legs under the body to get up."""

from __future__ import annotations

import numpy as np

from aerial_model.kinematics import Configuration
from aerial_model.robot.robot import JOINT_POSITION, JOINT_VELOCITY
from aerial_wbic.behaviours.behaviour import Behaviour, Event
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.behaviours.rest import Resting, rest_target
from aerial_wbic.behaviours.rest_trajectory import TIME, sampled_trajectory, trajectory_to_rest
from aerial_wbic.target import PostureTarget


class Sink(Resting):
    """Sinks to where the joints can be let go, balanced on all contact points."""

    name = "sink"

    def start_from(self, time: float, state: Configuration) -> None:
        """Sink from where the robot is."""
        gains = self._setting.gains
        self._rest = rest_target(self._setting, time, state, gains.lying_height, gains.lying_rate)

    def phase(self, time: float) -> Phase:
        """Return LIE."""
        return Phase.LIE

    def observed(self, time: float, state: Configuration) -> Event | None:
        """Return that the robot is down, when it should be; TILTED before all else."""
        event = super().observed(time, state)
        return Event.SUNK if event is None and time >= self.rest.end else event


class Lie(Behaviour):
    """Lies on the ground, joints damped."""

    name = "lie"
    settled = True

    def phase(self, time: float) -> Phase:
        """Return LIE."""
        return Phase.LIE

    def target(self, time: float, state: Configuration) -> None:
        """Return nothing: the joints are only damped."""
        return


class Fold(Behaviour):
    """Folds the legs of a robot that lies under its body."""

    name = "fold"

    def start_from(self, time: float, state: Configuration) -> None:
        """Fold the legs from where they are."""
        self._target = FoldTarget(
            state, time, rate=self._setting.gains.lying_rate, pose=self._setting.robot.poses["tuck"]
        )

    def phase(self, time: float) -> Phase:
        """Return LIE."""
        return Phase.LIE

    def observed(self, time: float, state: Configuration) -> Event | None:
        """Return FOLDED when the legs should be."""
        return Event.FOLDED if time >= self._target.end else None

    def target(self, time: float, state: Configuration) -> PostureTarget:
        """Return the joints' course to the folded pose."""
        return self._target.at(time)


class FoldTarget:
    """Brings the joints from where they are to a pose, along a trajectory to rest.

    Args:
        state: of the robot at the beginning.
        time: of the beginning [s].
        rate: at which the distance dies away [1/s].
        pose: joint positions ``(n,)`` [rad].
    """

    def __init__(self, state: Configuration, time: float, *, rate: float, pose: np.ndarray) -> None:
        self._begin = time
        self._joints = trajectory_to_rest(state.q[JOINT_POSITION], state.v[JOINT_VELOCITY], pose, rate)
        self.end = time + TIME / rate  # [s]

    def at(self, time: float) -> PostureTarget:
        """Return the target at ``time`` [s]."""
        position, velocity, _ = sampled_trajectory(self._joints, time - self._begin)
        return PostureTarget(joint_position=position, joint_velocity=velocity)
