"""A plan: the timed trajectory from the start of a motion to its planned touchdown, and where and how to land.

Times count from the start of the motion; positions are in the start heading frame S (origin at the centre of the
support on the ground, x along the heading, z up) until ``placed`` expresses the plan in another frame.
"""

from __future__ import annotations

import dataclasses
from bisect import bisect_right
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import NamedTuple

import numpy as np

from aerial_model.errors import InvalidPlanError
from aerial_model.numerics import rotation
from aerial_model.numerics.components import exp_of, inverse_of, log_of, product_of, quaternion
from aerial_model.numerics.jit import compiled
from aerial_model.robot.robot import BASE_ORIENTATION, BASE_POSITION, JOINT_POSITION, Robot
from aerial_model.values.contact_sequence import ContactPhase, ContactSequence
from aerial_model.values.frame import StartFrame
from aerial_model.values.terrain import Terrain

QUATERNION_TOLERANCE = 1e-6  # deviation of the norm from 1
TIME_TOLERANCE = 1e-9  # [s] of a sum of time steps
_WIDTH = 7 + 6 + 9  # of a row that is interpolated, without joints: pose and twist of the base, r, ṙ, α


class Ending(StrEnum):
    """What a motion ends in."""

    STAND = "stand"  # the robot stands where it landed


class Target(NamedTuple):
    """A plan sampled at one time, in the plan's frame."""

    q: np.ndarray  # (nq,)
    v: np.ndarray  # (nv,)
    com: np.ndarray  # (3,) [m]
    com_velocity: np.ndarray  # (3,) [m/s]
    com_acceleration: np.ndarray  # (3,) [m/s²]
    angular_momentum: np.ndarray  # (3,) [kg·m²/s]
    angular_momentum_rate: np.ndarray  # (3,) [N·m]
    vdot: np.ndarray  # (nv,) slope of v between the knots
    force: np.ndarray  # (n_c, 3) [N]
    contact: np.ndarray  # (n_c,) bool


class Track(NamedTuple):
    """A plan as it is sampled."""

    knots: np.ndarray  # rows [q, v, r, ṙ, α] (K, nq + nv + 9), units and frame as of the plan
    slopes: np.ndarray  # their change over the interval that follows, per second (K − 1, nq + nv + 9)
    time: np.ndarray  # (K,) [s]
    force: np.ndarray  # (K, n_c, 3) [N]
    contact: np.ndarray  # (K, n_c) bool

    @classmethod
    def still(cls, n: int, n_c: int) -> Track:
        """Return a track of n joints and n_c contact points on which nothing moves."""
        knots = np.zeros((2, 2 * n + _WIDTH))
        return cls(knots, knots[1:].copy(), np.arange(2.0), np.zeros((2, n_c, 3)), np.zeros((2, n_c), dtype=bool))

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return (self.knots.shape[1] - _WIDTH) // 2


@compiled
def sampled(track: Track, time: float) -> Target:
    """Return a plan at ``time`` [s], held at its ends; states are interpolated between knots, forces held."""
    knots, slopes = track.knots, track.slopes
    k = min(max(int(np.searchsorted(track.time, time, side="right")) - 1, 0), len(slopes) - 1)
    s = min(max(time - track.time[k], 0.0), track.time[k + 1] - track.time[k])
    row, slope = knots[k] + s * slopes[k], slopes[k].copy()
    share = s / (track.time[k + 1] - track.time[k])
    begin, end = quaternion(knots[k, BASE_ORIENTATION]), quaternion(knots[k + 1, BASE_ORIENTATION])
    turn = log_of(product_of(inverse_of(begin), end))
    orientation = product_of(begin, exp_of((share * turn[0], share * turn[1], share * turn[2])))
    for i in range(4):
        row[BASE_ORIENTATION.start + i] = orientation[i]
    nq = JOINT_POSITION.start + (knots.shape[1] - _WIDTH) // 2
    com, rest = 2 * nq - 1, 2 * nq + 2  # nv = nq − 1
    return Target(
        row[:nq],
        row[nq:com],
        row[com:rest],
        row[rest : rest + 3],
        slope[rest : rest + 3],
        row[rest + 3 :],
        slope[rest + 3 :],
        slope[nq:com],
        track.force[k].copy(),
        track.contact[k].copy(),
    )


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A checked trajectory over K knots; forces and contacts hold on [t_k, t_k+1).

    The first row of q and v is the state the motion starts from, at rest or not; which points are in contact then, and
    where they are, may differ from phase to phase of the take-off.
    """

    motion: str
    robot: str
    model_hash: str
    time: np.ndarray  # (K,) [s], from 0 to landing_time
    q: np.ndarray  # (K, nq)
    v: np.ndarray  # (K, nv)
    com: np.ndarray  # (K, 3) [m]
    com_velocity: np.ndarray  # (K, 3) [m/s]
    angular_momentum: np.ndarray  # (K, 3) [kg·m²/s]
    foot_position: np.ndarray  # (K, n_c, 3) [m]
    force: np.ndarray  # (K, n_c, 3) on the robot [N]
    contact: np.ndarray  # (K, n_c) bool
    take_off_time: float  # the last contact ends [s]
    landing_time: float  # planned touchdown [s]
    landing_joint_position: np.ndarray  # (n,) [rad]
    landing_com_height: float  # to hold after landing, above the landing surface [m]
    landing_support_centre: np.ndarray  # (3,) of the landing feet, z: the surface [m]
    landing_yaw: float  # heading after landing [rad]
    rotation: np.ndarray  # (3,) accumulated rotation ∫ω dt from start to landing [rad]
    terrain: Terrain = field(default_factory=Terrain)
    request_id: str = ""
    ending: Ending = Ending.STAND

    def checked(self, robot: Robot) -> Plan:
        """Return this plan if it is consistent, finite and made for ``robot``.

        Raises:
            InvalidPlanError: naming the field, what was expected and what was found.
        """
        if self.model_hash != robot.model_hash:
            raise InvalidPlanError(
                f"plan is for robot '{self.robot}' ({self.model_hash}), this one is '{robot.name}' ({robot.model_hash})"
            )
        self._check_arrays(robot)
        self._check_numbers()
        norms = np.linalg.norm(self.q[:, BASE_ORIENTATION], axis=1)
        if np.any(np.abs(norms - 1) > QUATERNION_TOLERANCE):
            raise InvalidPlanError("plan field q: a base quaternion has not length 1")
        return self

    def _check_arrays(self, robot: Robot) -> None:
        """Check that arrays have the shapes that the robot and the number of knots ask for, and that they are finite."""
        knots, n_c = len(self.time), robot.n_contacts
        shapes: dict[str, tuple[int, ...]] = {
            "time": (knots,),
            "q": (knots, robot.model.nq),
            "v": (knots, robot.model.nv),
            "com": (knots, 3),
            "com_velocity": (knots, 3),
            "angular_momentum": (knots, 3),
            "foot_position": (knots, n_c, 3),
            "force": (knots, n_c, 3),
            "contact": (knots, n_c),
            "landing_joint_position": (robot.n_joints,),
            "landing_support_centre": (3,),
            "rotation": (3,),
        }
        for name, shape in shapes.items():
            value = np.asarray(getattr(self, name))
            if value.shape != shape:
                raise InvalidPlanError(f"plan field {name}: expected shape {shape}, found {value.shape}")
            if not np.all(np.isfinite(value)):
                first = np.argwhere(~np.isfinite(value))[0].tolist()
                raise InvalidPlanError(f"plan field {name}: not finite at index {first}")
        if np.asarray(self.contact).dtype != bool:
            raise InvalidPlanError(f"plan field contact: expected truth values, found {np.asarray(self.contact).dtype}")

    def _check_numbers(self) -> None:
        """Check that times increase, that the take-off ends before the landing, and that all numbers are finite."""
        for name in ("take_off_time", "landing_time", "landing_com_height", "landing_yaw"):
            if not np.isfinite(getattr(self, name)):
                raise InvalidPlanError(f"plan field {name}: expected a finite number, found {getattr(self, name)}")
        if len(self.time) < 2 or np.any(np.diff(self.time) <= 0) or self.time[0] != 0.0:
            raise InvalidPlanError("plan field time: expected at least two times that start at 0 and increase")
        if not 0 < self.take_off_time < self.landing_time <= self.time[-1] + TIME_TOLERANCE:
            raise InvalidPlanError(
                f"plan: expected 0 < take_off_time < landing_time ≤ last time, found {self.take_off_time}, "
                f"{self.landing_time}, {self.time[-1]}"
            )

    def placed(self, frame: StartFrame) -> Plan:
        """Return the plan, given in its start heading frame, in the frame in which that one lies as ``frame`` says."""
        R, origin, turn = frame.R_WS, frame.origin, frame.orientation
        q = self.q.copy()
        q[:, BASE_POSITION] = self.q[:, BASE_POSITION] @ R.T + origin
        q[:, BASE_ORIENTATION] = rotation.multiply(turn, self.q[:, BASE_ORIENTATION])
        return dataclasses.replace(
            self,
            q=q,
            com=self.com @ R.T + origin,
            com_velocity=self.com_velocity @ R.T,
            angular_momentum=self.angular_momentum @ R.T,
            foot_position=self.foot_position @ R.T + origin,
            force=self.force @ R.T,
            landing_support_centre=R @ self.landing_support_centre + origin,
            landing_yaw=self.landing_yaw + frame.heading,
            rotation=R @ self.rotation,
            terrain=self.terrain.placed(frame),
        )

    def sample(self, time: float) -> Target:
        """Return the plan at ``time`` [s], held at its ends; states are interpolated between knots, forces held."""
        return sampled(self.track, time)

    def interval(self, time: float) -> int:
        """Return the number k of the interval [t_k, t_k+1) that ``time`` [s] is in; before the first and after the last: these."""
        return min(max(bisect_right(self._begins, time) - 1, 0), len(self._begins) - 1)

    @cached_property
    def _begins(self) -> list[float]:
        return self.time[:-1].tolist()

    @cached_property
    def track(self) -> Track:
        """The plan as it is sampled.

        Raises:
            InvalidPlanError: if it has less than two knots.
        """
        if len(self.time) < 2:
            raise InvalidPlanError(f"plan field time: expected at least two times, found {len(self.time)}")
        rows = np.hstack([self.q, self.v, self.com, self.com_velocity, self.angular_momentum])
        slopes = np.diff(rows, axis=0) / np.diff(self.time)[:, None]
        # Compiled code takes arrays of one kind, whoever made the plan: writable, row by row.
        knots, slopes, time, force = (
            np.array(each, dtype=float, order="C") for each in (rows, slopes, self.time, self.force)
        )
        return Track(knots, slopes, time, force, np.array(self.contact, dtype=bool, order="C"))

    @cached_property
    def contact_sequence(self) -> ContactSequence:
        """The contacts from the start to touchdown, with footholds in the plan's frame; its last phase is the flight.

        A point that bears load from one phase to the next keeps the foothold it had first.
        """
        held = self.contact[:-1]  # the last row holds for no time
        begins = [0, *(np.flatnonzero(np.any(held[1:] != held[:-1], axis=1)) + 1).tolist()]
        ends = [*begins[1:], len(held)]
        phases: list[ContactPhase] = []
        for begin, end in zip(begins, ends, strict=True):
            contact, foothold = held[begin].copy(), self.foot_position[begin].copy()
            if phases:
                both = contact & phases[-1].contact
                foothold[both] = phases[-1].foothold[both]
            duration = float(self.time[end] - self.time[begin])
            phases.append(ContactPhase(duration=duration, contact=contact, foothold=foothold))
        return ContactSequence(phases=tuple(phases))

    @property
    def landing_pose(self) -> np.ndarray:
        """Planned configuration ``(nq,)`` at touchdown."""
        return self.q[-1]

    @property
    def start_joint_position(self) -> np.ndarray:
        """Joint positions ``(n,)`` [rad] the plan starts from."""
        return self.q[0, JOINT_POSITION]
