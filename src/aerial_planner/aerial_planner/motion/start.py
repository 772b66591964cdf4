"""Where and how a motion starts: at rest in a stance, or in the middle of another motion."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from aerial_model.errors import ConfigurationError
from aerial_model.robot.robot import BASE_ORIENTATION, BASE_TWIST, JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_model.values.contact_sequence import ContactPhase, ContactSequence
from aerial_model.values.estimate import Estimate
from aerial_model.values.frame import StartFrame

FOOTHOLD_MISMATCH = (
    0.05  # by which a loaded point may be off its foothold: estimates and predictions err by a third [m]
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Start:
    """State of a robot as a motion starts, in the start heading frame S, and the take-off that follows from it."""

    q: np.ndarray  # (nq,) base position [m], quaternion xyzw with w ≥ 0, joint positions [rad]
    v: np.ndarray  # (nv,) base twist in B, linear first [m/s, rad/s], joint velocities [rad/s]
    contact: np.ndarray  # (n_c,) bool, the points that bear load
    sequence: ContactSequence | None = None  # contacts and footholds of the take-off, in S; None: those of the motion

    @staticmethod
    def standing(robot: Robot) -> Start:
        """Return the start from the home stance."""
        return Start(
            q=robot.standing_configuration(), v=np.zeros(robot.model.nv), contact=np.ones(robot.n_contacts, dtype=bool)
        )

    @staticmethod
    def at(robot: Robot, estimate: Estimate) -> Start:
        """Return the start of a robot that stands on all points: small velocities of the estimate are noise."""
        q = _facing_ahead(StartFrame.of(robot, estimate.q).local(estimate.q))
        return Start(q=q, v=np.zeros(robot.model.nv), contact=np.ones(robot.n_contacts, dtype=bool))

    @staticmethod
    def moving(robot: Robot, estimate: Estimate, sequence: ContactSequence) -> Start:
        """Return the start of a robot in motion, whose velocities count.

        Points that bear load already stand where ``estimate.q`` has them; the sequence says where others are to land.

        Args:
            robot: that moves.
            estimate: its state as the take-off begins, predicted or estimated.
            sequence: the take-off, each of whose phases has a point that bears load; footholds in the estimate's frame.

        Raises:
            ConfigurationError: if the sequence is for another number of points, has a phase without any that bears load,
                or one of its footholds is not where the loaded point is.
        """
        _check_sequence(robot, estimate.q, sequence)
        contact = np.array(sequence.phases[0].contact, dtype=bool)
        frame = StartFrame.of(robot, estimate.q, contact)
        local = _standing_where_it_is(sequence, robot.contact_positions(estimate.q))
        phases = tuple(
            dataclasses.replace(phase, foothold=(phase.foothold - frame.origin) @ frame.R_WS) for phase in local.phases
        )
        return Start(
            q=_facing_ahead(frame.local(estimate.q)),
            v=np.array(estimate.v, dtype=float),
            contact=contact,
            sequence=ContactSequence(phases=phases),
        )

    def planned(self, robot: Robot) -> Start:
        """Return the start of ``robot.planned``, without the joints that plans leave at home."""
        joints = robot.planned_joints
        return dataclasses.replace(
            self,
            q=np.concatenate([self.q[: JOINT_POSITION.start], self.q[JOINT_POSITION][joints]]),
            v=np.concatenate([self.v[BASE_TWIST], self.v[JOINT_VELOCITY][joints]]),
        )


def _facing_ahead(q: np.ndarray) -> np.ndarray:
    """Return ``q`` with the one of the two quaternions of its attitude that has not turned."""
    if q[BASE_ORIENTATION][3] < 0:
        q[BASE_ORIENTATION] = -q[BASE_ORIENTATION]
    return q


def _check_sequence(robot: Robot, q: np.ndarray, sequence: ContactSequence) -> None:
    first = sequence.phases[0]
    if len(first.contact) != robot.n_contacts:
        raise ConfigurationError(
            f"contact sequence: expected {robot.n_contacts} contact points of {robot.name}, found {len(first.contact)}"
        )
    for number, phase in enumerate(sequence.phases, start=1):
        if not np.any(phase.contact):
            raise ConfigurationError(
                f"contact sequence: no point bears load in phase {number} of {len(sequence.phases)} of the take-off; "
                "the flight begins after the last phase"
            )
    gaps = np.where(first.contact, np.linalg.norm(robot.contact_positions(q) - first.foothold, axis=1), 0.0)
    if gaps.max() > FOOTHOLD_MISMATCH:
        name = robot.contact_points[int(np.argmax(gaps))].name
        raise ConfigurationError(
            f"contact sequence: point {name} bears load {gaps.max():.3f} m from its foothold, at most "
            f"{FOOTHOLD_MISMATCH} m are expected"
        )


def _standing_where_it_is(sequence: ContactSequence, points: np.ndarray) -> ContactSequence:
    """Return the sequence with points that bear load from the beginning on standing at ``points`` ``(n_c, 3)`` until they leave."""
    phases: list[ContactPhase] = []
    loaded = np.ones(len(points), dtype=bool)
    for phase in sequence.phases:
        loaded = loaded & phase.contact
        phases.append(dataclasses.replace(phase, foothold=np.where(loaded[:, None], points, phase.foothold)))
    return ContactSequence(phases=tuple(phases))
