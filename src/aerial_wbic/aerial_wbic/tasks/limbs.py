"""Which joints a task leads, given which contact points carry load."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerial_model.numerics.layout import Layout
from aerial_model.robot.robot import JOINT_VELOCITY, Robot


class Joints(NamedTuple):
    """What tasks lead: it depends on which points carry load."""

    rank: np.ndarray  # (n_c,) how many velocities of a loaded point the points before it on its link leave open; else 0
    mate: np.ndarray  # (n_c, 2) the first two loaded points on its link
    swinging: np.ndarray  # (n_s,) of limbs in the air
    spare: np.ndarray  # (n_r,) of limbs with load and more joints than their points hold
    posed: np.ndarray  # (n_p,) that a posture is asked of: arms, or all that do not swing when there are none
    block: np.ndarray  # of whole numbers, what all these arrays lie in


JOINTS = Layout(
    sizes=("n_c", "n_swinging", "n_spare", "n_posed"),
    arrays={
        "rank": ("n_c",),
        "mate": ("n_c", 2),
        "swinging": ("n_swinging",),
        "spare": ("n_spare",),
        "posed": ("n_posed",),
    },
    kind=int,
)
joints_in = JOINTS.reader(Joints)


class Limbs:
    """Which joints carry which contact point: a limb swings when its point is in the air and no loaded one needs it."""

    def __init__(self, robot: Robot) -> None:
        model = robot.model
        chains = np.zeros((robot.n_contacts, robot.n_joints), dtype=bool)
        for i, frame in enumerate(robot.contact_frames):
            for joint in list(model.supports[model.frames[frame].parentJoint])[2:]:  # 0: universe, 1: base
                chains[i, model.joints[joint].idx_v - JOINT_VELOCITY.start] = True
        self._chains = chains  # (n_c, n)
        self._links = robot.contact_links
        self._joints: dict[bytes, Joints] = {}  # what was asked before

    def joints(self, contact: np.ndarray) -> Joints:
        """Return the joints that tasks lead, given which points ``(n_c,)`` carry load."""
        key = contact.tobytes()
        if key not in self._joints:
            swinging = self._chains[~contact].any(axis=0) & ~self._chains[contact].any(axis=0)
            arms = ~self._chains.any(axis=0)
            posed = arms if arms.any() else ~swinging
            rank, mate = np.zeros(len(contact), dtype=int), np.zeros((len(contact), 2), dtype=int)
            for i in np.flatnonzero(contact):
                fellows = np.flatnonzero(contact & (self._links == self._links[i]))
                rank[i] = max(0, 3 - int(np.flatnonzero(fellows == i)[0]))
                mate[i] = fellows[:2] if len(fellows) > 1 else i
            spare = np.zeros(self._chains.shape[1], dtype=bool)
            for link in np.unique(self._links[contact]):
                fellows = contact & (self._links == link)
                chain = self._chains[fellows].any(axis=0)
                spare |= chain & (np.count_nonzero(chain) > rank[fellows].sum())
            lead = {"swinging": swinging, "spare": spare, "posed": posed}
            self._joints[key] = _joints_of(rank, mate, **{name: np.flatnonzero(each) for name, each in lead.items()})
        return self._joints[key]


def _joints_of(
    rank: np.ndarray, mate: np.ndarray, swinging: np.ndarray, spare: np.ndarray, posed: np.ndarray
) -> Joints:
    sizes = {"n_swinging": len(swinging), "n_spare": len(spare), "n_posed": len(posed)}
    joints = joints_in(JOINTS.block(n_c=len(rank), **sizes))
    for array, values in zip(joints, (rank, mate, swinging, spare, posed), strict=False):
        array[:] = values
    return joints
