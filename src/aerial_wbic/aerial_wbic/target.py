"""What the robot should do now, and the memory that it is written into.

All behaviours that balance the robot give the same thing, so that one hierarchy serves take-off, flight, landing and standing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.numerics.jit import compiled
from aerial_model.numerics.layout import cut, cut_flags, cut_rows, flags_size
from aerial_wbic.gains import BodyGains, Feedback


class BodyTarget(NamedTuple):
    """Centre of mass and base attitude, in W, with the gains that hold them there."""

    com: np.ndarray  # (3,) [m]
    com_velocity: np.ndarray  # (3,) [m/s]
    com_acceleration: np.ndarray  # (3,) [m/s²]
    orientation: np.ndarray  # (4,) quaternion xyzw
    angular_velocity: np.ndarray  # (3,) [rad/s]
    angular_acceleration: np.ndarray  # (3,) [rad/s²]
    gains: BodyGains


class WholeBodyTarget(NamedTuple):
    """Everything the hierarchy and the optimization follow in one tick; all arrays lie in one block."""

    body: BodyTarget
    joint_position: np.ndarray  # (n,) [rad]
    joint_velocity: np.ndarray  # (n,) [rad/s]
    joint_acceleration: np.ndarray  # (n,) [rad/s²]
    angular_momentum: np.ndarray  # (3,) [kg·m²/s]
    angular_momentum_rate: np.ndarray  # (3,) [N·m]
    force: np.ndarray  # f_cmd (n_c, 3) in W [N]
    contact: np.ndarray  # (n_c,) bool
    block: np.ndarray  # what all these arrays lie in


_N, _N_C, _GAINS, _HEADER = 0, 1, 2, 6  # where a block says how many joints and points there are, and the body's gains


def blank_target(n: int, n_c: int, gains: BodyGains) -> WholeBodyTarget:
    """Return the memory of a target for n joints and n_c contact points, none of which carries load."""
    block = np.zeros(_HEADER + 19 + 3 * n + 6 + 3 * n_c + flags_size(n_c))
    block[:_HEADER] = n, n_c, *gains.position, *gains.attitude
    return target_in(block)


@compiled
def target_in(block: np.ndarray) -> WholeBodyTarget:
    """Return the target that lies in a block."""
    n, n_c = int(block[_N]), int(block[_N_C])
    com, at = cut(block, _HEADER, 3)
    com_velocity, at = cut(block, at, 3)
    com_acceleration, at = cut(block, at, 3)
    orientation, at = cut(block, at, 4)
    angular_velocity, at = cut(block, at, 3)
    angular_acceleration, at = cut(block, at, 3)
    joint_position, at = cut(block, at, n)
    joint_velocity, at = cut(block, at, n)
    joint_acceleration, at = cut(block, at, n)
    angular_momentum, at = cut(block, at, 3)
    angular_momentum_rate, at = cut(block, at, 3)
    force, at = cut_rows(block, at, n_c, 3)
    contact, at = cut_flags(block, at, n_c)
    gains = BodyGains(
        Feedback(block[_GAINS], block[_GAINS + 1]),
        Feedback(block[_GAINS + 2], block[_GAINS + 3]),
    )
    body = BodyTarget(com, com_velocity, com_acceleration, orientation, angular_velocity, angular_acceleration, gains)
    return WholeBodyTarget(
        body,
        joint_position,
        joint_velocity,
        joint_acceleration,
        angular_momentum,
        angular_momentum_rate,
        force,
        contact,
        block,
    )


class PostureTarget(NamedTuple):
    """Joint positions, for a robot that lies and has nothing to balance."""

    joint_position: np.ndarray  # (n,) [rad]
    joint_velocity: np.ndarray  # (n,) [rad/s]


def copied_target(target: WholeBodyTarget | PostureTarget | None) -> WholeBodyTarget | PostureTarget | None:
    """Return a target that the next tick does not overwrite."""
    if isinstance(target, WholeBodyTarget):
        return target_in(target.block.copy())
    return target  # the arrays of a posture are nobody's memory
