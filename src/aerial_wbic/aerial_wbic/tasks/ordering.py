"""Which tasks there are, and in which order or with which weights they make the accelerations."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from aerial_model.numerics.layout import Layout
from aerial_wbic.gains import ControllerGains, Feedback, TaskOrder

N_TASKS = 4  # of every ordering


class TaskKind(IntEnum):
    """What a task states."""

    NOTHING = 0
    LIMBS = 1
    BASE = 2
    ANGULAR_MOMENTUM = 3
    MOMENTUM = 4
    POSTURE = 5
    SPARE_JOINTS = 6


class TaskOrdering(NamedTuple):
    """Which tasks the accelerations come from. Of all orderings the type is the same: one compiled tick serves all."""

    order: np.ndarray  # (4,) of TaskKind, the most important first
    weights: np.ndarray  # (4,) of the tasks in one least-squares problem, or (0,) for strict priority
    limbs: Feedback  # gains of joints that are led
    angular_momentum_damping: float  # [1/s]
    block: np.ndarray  # what all of it lies in


ORDERING = Layout(
    sizes=("n_weights",),
    numbers=("limbs.stiffness", "limbs.damping", "angular_momentum_damping"),
    arrays={"order": (N_TASKS,), "weights": ("n_weights",)},
)
ordering_in = ORDERING.reader(TaskOrdering)

_ORDERS = {
    TaskOrder.WBC_A: (TaskKind.LIMBS, TaskKind.BASE, TaskKind.SPARE_JOINTS, TaskKind.ANGULAR_MOMENTUM),
    TaskOrder.WBC_B: (TaskKind.LIMBS, TaskKind.MOMENTUM, TaskKind.SPARE_JOINTS, TaskKind.NOTHING),
    TaskOrder.WBC_C: (TaskKind.LIMBS, TaskKind.BASE, TaskKind.SPARE_JOINTS, TaskKind.POSTURE),
    TaskOrder.WEIGHTED: (TaskKind.LIMBS, TaskKind.BASE, TaskKind.SPARE_JOINTS, TaskKind.ANGULAR_MOMENTUM),
}


def task_ordering(gains: ControllerGains) -> TaskOrdering:
    """Return the ordering that a controller's gains ask for."""
    order = _ORDERS[gains.tasks]
    weighted = gains.tasks is TaskOrder.WEIGHTED
    ordering = ordering_in(
        ORDERING.block(
            n_weights=N_TASKS if weighted else 0,
            limbs__stiffness=gains.swing_joint.stiffness,
            limbs__damping=gains.swing_joint.damping,
            angular_momentum_damping=gains.angular_momentum_damping,
        )
    )
    ordering.order[:] = order
    if weighted:
        ordering.weights[:] = [getattr(gains.task_weights, kind.name.lower()) for kind in order]
    return ordering
