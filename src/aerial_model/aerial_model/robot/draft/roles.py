"""Which joints plans treat apart: those that AAKD* takes as fixed, and those that every plan holds at home."""

from __future__ import annotations

from aerial_model.robot.draft.limbs import Legs
from aerial_model.robot.draft.mechanism import FIRST_JOINT, Mechanism

_ARM = 0.15  # of the robot's mass, which an arm weighs at most


def frozen_joints(mechanism: Mechanism, legs: Legs) -> list[str]:
    """Return the legs' joints that turn about other axes than the lateral one."""
    joints = {j for limb in legs.limbs for j in limb.joints if not mechanism.is_lateral(j)}
    return _named(mechanism, sorted(mechanism.index(j) for j in joints))


def held_joints(mechanism: Mechanism, legs: Legs) -> list[str]:
    """Return the joints that plans leave alone: of limbs that do not stand, all but what swings an arm.

    An arm is light and hangs, and the first of its joints that turns about the lateral axis swings all of it.
    """
    model, data = mechanism.model, mechanism.data
    standing = {j for limb in legs.limbs for j in limb.joints}
    others = [j for j in range(FIRST_JOINT, model.njoints) if j not in standing]
    light = _ARM * mechanism.mass
    swings: set[int] = set()
    for j in others:  # parents come first
        hangs = data.oMi[j].act(data.com[j])[2] < data.oMi[j].translation[2]
        is_first = not swings & set(model.supports[j])
        if mechanism.is_lateral(j) and hangs and data.mass[j] < light and is_first:
            swings.add(j)
    return _named(mechanism, [mechanism.index(j) for j in others if j not in swings])


def _named(mechanism: Mechanism, indices: list[int]) -> list[str]:
    return [mechanism.joint_names[j] for j in indices]
