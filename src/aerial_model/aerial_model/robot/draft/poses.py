"""Poses of a draft: legs bent under the body, knees behind of quadrupeds and ahead of bipeds, feet flat below the hips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from aerial_model.robot.draft.limbs import Legs, Limb
from aerial_model.robot.draft.mechanism import Mechanism, in_base
from aerial_model.robot.inverse_kinematics import least_squares

_CROUCH, _CROUCH_BIPED = 0.7, 0.9  # leg length at home over that of the straight leg
_FOLD, _FOLD_BIPED = 0.6, 0.7  # leg length tucked over that at home
_ASTRIDE = 0.1  # leg lengths by which the feet of a biped that lands stand wider than at home
_MIDDLE = 1e-3  # [m] from the middle, within which a foot is on neither side
_BENT = (-0.7, 1.4)  # hip and knee of a leg to start from [rad]
_BENT_WITH_ANKLE = (-0.5, 1.0, -0.5)  # … of one whose foot keeps flat
_ITERATIONS = 200
_STEP_MAX = 0.2  # [rad]
_MISS = 1e3  # [1/m] what a miss costs beside a knee that is on the wrong side


@dataclass(frozen=True, kw_only=True)
class Poses:
    """Joint positions ``(n,)`` [rad] by the names that ``robot.yaml`` has for them."""

    home: np.ndarray
    landing: np.ndarray
    tuck: np.ndarray


def poses_of(mechanism: Mechanism, legs: Legs) -> Poses:
    """Return the poses in which a robot with these legs stands, lands and folds in flight."""
    crouch, fold = (_CROUCH_BIPED, _FOLD_BIPED) if legs.is_biped else (_CROUCH, _FOLD)
    home = _standing(mechanism, legs, crouch)
    tuck = _standing(mechanism, legs, crouch * fold, home)
    landing = _standing(mechanism, legs, 0.5 + 0.5 * crouch, home, _ASTRIDE) if legs.is_biped else home
    return Poses(home=home, landing=landing, tuck=tuck)


def _standing(
    mechanism: Mechanism, legs: Legs, share: float, guess: np.ndarray | None = None, wider: float = 0.0
) -> np.ndarray:
    """Return joint positions ``(n,)`` with each leg bent to a ``share`` of its straight length, feet flat below it.

    Args:
        mechanism: the robot.
        legs: that stand.
        share: of a leg's straight length.
        guess: joint positions to start from ``(n,)`` [rad]; None: legs bent either way, the better of which is taken.
        wider: leg lengths by which feet stand farther out than with straight legs.
    """
    pose = np.clip(np.zeros(len(mechanism.limits[0])), *mechanism.limits) if guess is None else guess
    for limb in legs.limbs:
        starts = _bent_either_way(mechanism, limb, pose) if guess is None else [pose]
        placed = [_placed(mechanism, limb, start, share, wider) for start in starts]
        pose = min(placed, key=lambda q_j: _cost(mechanism, limb, q_j, share, wider, knees_ahead=legs.is_biped))
    return pose


def _bent_either_way(mechanism: Mechanism, limb: Limb, q_j: np.ndarray) -> list[np.ndarray]:
    """Return joint positions with a leg's knee bent forwards, and backwards."""
    lateral = [j for j in limb.joints if mechanism.is_lateral(j)]
    has_ankle = len(lateral) > 2
    joints, pattern = (lateral[-3:], _BENT_WITH_ANKLE) if has_ankle else (lateral, _BENT)
    starts = []
    for sense in (1.0, -1.0):
        start = q_j.copy()
        for j, angle in zip(joints, pattern, strict=False):
            start[mechanism.index(j)] = sense * angle * np.sign(mechanism.axis(j)[1])
        starts.append(np.clip(start, *mechanism.limits))
    return starts


def _targets(mechanism: Mechanism, limb: Limb, share: float, wider: float) -> np.ndarray:
    """Return where a leg's contact points ``(k, 3)`` [m] should be in the base."""
    flat = np.array([in_base(mechanism.data, *point) for point in limb.foot.points])
    centre = flat.mean(axis=0)
    length = mechanism.data.oMi[limb.joints[0]].translation[2] - centre[2]
    side = np.sign(centre[1]) if abs(centre[1]) > _MIDDLE else 0.0
    return flat + [0.0, side * wider * length, (1 - share) * length]


def _placed(mechanism: Mechanism, limb: Limb, start: np.ndarray, share: float, wider: float) -> np.ndarray:
    """Return joint positions ``(n,)`` with a leg's contact points as near their targets as its joints let them."""
    model, data = mechanism.model, mechanism.model.createData()
    targets = _targets(mechanism, limb, share, wider)
    own = [mechanism.index(j) for j in limb.joints]
    q = pin.neutral(model)
    q[7:] = start

    def residual(q_leg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q[7:][own] = q_leg
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        error, rows = [], []
        for (frame, offset), target in zip(limb.foot.points, targets, strict=True):
            error.append(target - in_base(data, frame, offset))
            J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            rows.append((J[:3] - pin.skew(data.oMf[frame].rotation @ offset) @ J[3:])[:, 6:][:, own])
        return np.concatenate(error), np.vstack(rows)

    low, high = mechanism.limits
    limits = low[own], high[own]
    q_j = start.copy()
    q_j[own] = least_squares(residual, start[own], limits, iterations=_ITERATIONS, step_max=_STEP_MAX)
    return q_j


def _cost(mechanism: Mechanism, limb: Limb, q_j: np.ndarray, share: float, wider: float, *, knees_ahead: bool) -> float:
    """Return what is wrong with a pose of a leg: how far its points miss their targets, then the side of its knee."""
    model, data = mechanism.model, mechanism.model.createData()
    q = pin.neutral(model)
    q[7:] = q_j
    pin.framesForwardKinematics(model, data, q)
    targets = _targets(mechanism, limb, share, wider)
    points = np.array([in_base(data, *point) for point in limb.foot.points])
    miss = float(np.max(np.linalg.norm(targets - points, axis=1)))
    hip = mechanism.data.oMi[limb.joints[0]].translation
    centre = np.mean([in_base(mechanism.data, *point) for point in limb.foot.points], axis=0)
    knees = [data.oMi[j].translation[0] - (hip[0] + centre[0]) / 2 for j in limb.joints]
    ahead = max(knees, key=abs)
    return round(miss, 3) * _MISS + float(-ahead if knees_ahead else ahead)
