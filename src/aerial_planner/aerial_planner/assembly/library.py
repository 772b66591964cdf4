"""Plans made before, kept as a folder of plan files: the nearest one starts the optimization of the next.

Candidates are plans for this very robot with the same contact schedule; nearness is that of goal and start. What a plan
was optimized for is not asked: it is a guess, and what comes of it is checked like any other plan.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerial_model.errors import AerialError, ConfigurationError, InvalidPlanError
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ANGULAR, BASE_ORIENTATION, GRAVITY, JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_model.values.plan import Plan
from aerial_model.values.plan_file import load_plan, save_plan
from aerial_planner.formulation.trajectory import TakeOffTrajectory
from aerial_planner.motion.schedule import Schedule
from aerial_planner.reference.body import Reference
from aerial_planner.reference.flight_path import FlightPath

_NEAR = 1.5  # distance up to which a stored plan is the better start, see decision 8
_SPACING = 0.1  # distance to a stored plan below which another one adds nothing
_SUFFIX = ".npz"
_SAME_TIME = 1e-6  # [s]


@dataclass(frozen=True, kw_only=True)
class _Entry:
    """A stored plan, and what it is found by."""

    plan: Plan
    n_knots: int  # N of its take-off
    place: np.ndarray  # (9 + n_p,), see ``_place``

    @property
    def contacts(self) -> bytes:
        return self.plan.contact[: self.n_knots].tobytes()


class PlanLibrary:
    """The plans for one robot in one folder; whatever else is there is skipped, with one sentence each.

    Args:
        folder: made when the first plan is added; files that ``aerial plan --out`` wrote may be put there.
        robot: whose plans count.
        warn: called with a sentence about each file that is skipped and each plan that could not be kept.

    Raises:
        ConfigurationError: if ``folder`` is no folder, or cannot be read.
    """

    def __init__(self, folder: Path, robot: Robot, warn: Callable[[str], None]) -> None:
        self.folder = folder
        self._warn = warn
        self._joints = robot.planned_joints
        self._entries: dict[bytes, list[_Entry]] = {}  # by contact schedule
        for path in _files(folder):
            try:
                self._keep(self._entry(load_plan(path, robot)))
            except InvalidPlanError as error:
                warn(f"plan library: {path.name} is skipped: {error}")

    def __len__(self) -> int:
        return sum(len(entries) for entries in self._entries.values())

    def nearest(self, schedule: Schedule, reference: Reference) -> TakeOffTrajectory | None:
        """Return the take-off of the nearest plan with this contact schedule; None if there is none near."""
        entries = self._entries.get(schedule.contact.tobytes(), [])
        height, start = reference.landing_com_height, reference.joint_position[0]
        place = _place(schedule.landing_centre, schedule.rotation, start, reference.com_velocity[0], height)
        distances = [float(np.linalg.norm(entry.place - place)) for entry in entries]
        if not distances or min(distances) > _NEAR:
            return None
        entry = entries[int(np.argmin(distances))]
        return _take_off(entry.plan, entry.n_knots, reference.flight_path, self._joints)

    def add(self, plan: Plan) -> None:
        """Keep a plan, on disk too, unless nearly the same one is there; a disk that fails is a warning, not an error."""
        entry = self._entry(plan)
        others = self._entries.get(entry.contacts, [])
        if any(np.linalg.norm(entry.place - other.place) < _SPACING for other in others):
            return
        self._keep(entry)
        try:
            self._write(entry)
        except AerialError as error:
            self._warn(f"kept in memory only: {error}")

    def _keep(self, entry: _Entry) -> None:
        self._entries.setdefault(entry.contacts, []).append(entry)

    def _entry(self, plan: Plan) -> _Entry:
        """Return a plan with what it is found by.

        Raises:
            InvalidPlanError: if its take-off is none that the planner could start from.
        """
        N = int(np.searchsorted(plan.time, plan.take_off_time - _SAME_TIME))
        if abs(plan.time[N] - plan.take_off_time) > _SAME_TIME or plan.contact[N:].any():
            raise InvalidPlanError(f"plan of {plan.motion}: expected a knot at take_off_time and no contact after it")
        start = plan.start_joint_position[self._joints]
        goal, velocity = plan.landing_support_centre, plan.com_velocity[0]
        place = _place(goal, plan.rotation, start, velocity, plan.landing_com_height)
        return _Entry(plan=plan, n_knots=N, place=place)

    def _write(self, entry: _Entry) -> None:
        """Write a plan's file, whole or not at all: another process may be reading the folder."""
        name = hashlib.sha256(entry.place.tobytes() + entry.contacts).hexdigest()[:12]
        path = self.folder / f"{entry.plan.motion}-{name}{_SUFFIX}"
        scratch = path.with_suffix(f".{os.getpid()}")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            save_plan(entry.plan, scratch)
            scratch.replace(path)
        except OSError as error:
            raise ConfigurationError(f"{path}: cannot be written ({error.strerror})") from None
        finally:
            with contextlib.suppress(OSError):
                scratch.unlink(missing_ok=True)


def _files(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.iterdir() if path.suffix == _SUFFIX)
    except FileNotFoundError:
        return []
    except OSError as error:
        raise ConfigurationError(f"plan library {folder}: cannot be read ({error.strerror})") from None


def _place(landing: np.ndarray, turn: np.ndarray, start: np.ndarray, velocity: np.ndarray, height: float) -> np.ndarray:
    """Return goal and start as a point ``(9 + n_p,)`` in a space where 1 is far: standing heights, radians, √(g h)."""
    return np.concatenate([landing / height, turn, start, velocity / np.sqrt(GRAVITY * height)])


def _take_off(plan: Plan, N: int, path: FlightPath, joints: np.ndarray) -> TakeOffTrajectory:
    """Return the take-off of a plan for its planned ``joints``, with rates that move its knots from one to the next as the optimizer's do."""
    knots = slice(0, N + 1)
    dt = np.diff(plan.time[knots])
    quaternion, q_j = plan.q[knots, BASE_ORIENTATION], plan.q[knots, JOINT_POSITION][:, joints]
    turn = rotation.log(rotation.multiply(rotation.conjugate(quaternion[:-1]), quaternion[1:]))
    M = len(path.fraction)
    samples = [plan.sample(time) for time in np.linspace(plan.take_off_time, plan.landing_time, M + 1)]
    return TakeOffTrajectory(
        dt=dt,
        com=plan.com[knots],
        com_velocity=plan.com_velocity[knots],
        angular_momentum=plan.angular_momentum[knots],
        orientation=quaternion,
        joint_position=q_j,
        angular_velocity=np.vstack([turn / dt[:, None], plan.v[N, BASE_ANGULAR]]),
        joint_velocity=np.vstack([np.diff(q_j, axis=0) / dt[:, None], plan.v[N, JOINT_VELOCITY][joints]]),
        force=plan.force[:N],
        flight_time=plan.landing_time - plan.take_off_time,
        flight_orientation=np.array([sample.q[BASE_ORIENTATION] for sample in samples]),
        flight_joint_position=path.at_knots(q_j[-1]),
        flight_angular_velocity=np.array([sample.v[BASE_ANGULAR] for sample in samples[:-1]]),
    )
