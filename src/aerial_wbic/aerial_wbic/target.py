"""What the robot should do now, and the memory that it is written into.

All behaviours that balance the robot give the same thing, so that one hierarchy serves take-off, flight, landing and standing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.numerics.layout import Layout
from aerial_wbic.gains import BodyGains


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


TARGET = Layout(
    sizes=("n", "n_c"),
    numbers=(
        "body.gains.position.stiffness",
        "body.gains.position.damping",
        "body.gains.attitude.stiffness",
        "body.gains.attitude.damping",
    ),
    arrays={
        "body.com": (3,),
        "body.com_velocity": (3,),
        "body.com_acceleration": (3,),
        "body.orientation": (4,),
        "body.angular_velocity": (3,),
        "body.angular_acceleration": (3,),
        "joint_position": ("n",),
        "joint_velocity": ("n",),
        "joint_acceleration": ("n",),
        "angular_momentum": (3,),
        "angular_momentum_rate": (3,),
        "force": ("n_c", 3),
        "contact": ("n_c",),
    },
    flags={"contact"},
)
target_in = TARGET.reader(WholeBodyTarget)


def blank_target(n: int, n_c: int, gains: BodyGains) -> WholeBodyTarget:
    """Return the memory of a target for n joints and n_c contact points, none of which carries load."""
    block = TARGET.block(
        n=n,
        n_c=n_c,
        body__gains__position__stiffness=gains.position.stiffness,
        body__gains__position__damping=gains.position.damping,
        body__gains__attitude__stiffness=gains.attitude.stiffness,
        body__gains__attitude__damping=gains.attitude.damping,
    )
    return target_in(block)


class PostureTarget(NamedTuple):
    """Joint positions, for a robot that lies and has nothing to balance."""

    joint_position: np.ndarray  # (n,) [rad]
    joint_velocity: np.ndarray  # (n,) [rad/s]


def copied_target(target: WholeBodyTarget | PostureTarget | None) -> WholeBodyTarget | PostureTarget | None:
    """Return a target that the next tick does not overwrite."""
    if isinstance(target, WholeBodyTarget):
        return target_in(target.block.copy())
    return target  # the arrays of a posture are nobody's memory
