"""Who touches the world, and how hard, read from MuJoCo's contact list."""

from __future__ import annotations

import mujoco
import numpy as np

from aerial_model.numerics.jit import compiled
from aerial_sim.world.world import WORLD_BODY, World

TOUCH_DEPTH_MAX = 0.005  # contact is stiff: what reaches deeper than this was not pressed in but put there [m]


class ContactSensing:
    """Collects the touches of one control period; only touches of the world count, not of the robot by itself."""

    def __init__(self, world: World) -> None:
        model = world.model
        self._world = world
        self._is_world = model.geom_bodyid == WORLD_BODY  # (ngeom,)
        self._is_point = np.zeros(model.ngeom, dtype=bool)
        self._is_point[world.contact_geoms] = True
        self._met = np.zeros((model.ngeom, model.ngeom), dtype=bool)  # which pairs touched, in MuJoCo's order
        self._point_of = {geom: i for i, geom in enumerate(world.contact_geoms.tolist())}
        self._wrench = np.zeros(6)
        _touched(self._met, self._is_world)  # compiles what no tick may
        _add_force(np.zeros(3), np.zeros(9), self._wrench, 1.0)

    def clear(self) -> None:
        """Forget the period."""
        self._met[:] = False

    def collect(self, data: mujoco.MjData) -> None:
        """Add the touches of the physics step just made."""
        pairs = data.contact.geom  # (ncon, 2)
        self._met[pairs[:, 0], pairs[:, 1]] = True

    @property
    def _touched(self) -> np.ndarray:
        """Which geoms touched the world ``(ngeom,)`` bool."""
        return _touched(self._met, self._is_world)

    @property
    def points(self) -> np.ndarray:
        """Contact points that touched the world ``(n_c,)`` bool."""
        return self._touched[self._world.contact_geoms]

    @property
    def other_links(self) -> tuple[str, ...]:
        """Links that touched the world elsewhere than at a contact point."""
        others = np.flatnonzero(self._touched & ~self._is_point)
        if not len(others):
            return ()
        model = self._world.model
        return tuple(model.body(body).name for body in np.unique(model.geom_bodyid[others]))

    def forces(self, data: mujoco.MjData) -> np.ndarray:
        """Return the force of the world on each contact point in the last physics step ``(n_c, 3)`` [N] in W."""
        forces = np.zeros((len(self._world.contact_geoms), 3))
        frames = data.contact.frame  # (ncon, 9) rows: normal (from first to second geom), two tangents, in W
        for k, (first, second) in enumerate(data.contact.geom.tolist()):
            point, other, sign = (second, first, 1.0) if second in self._point_of else (first, second, -1.0)
            if point not in self._point_of or not self._is_world[other]:
                continue
            mujoco.mj_contactForce(self._world.model, data, k, self._wrench)
            _add_force(forces[self._point_of[point]], frames[k], self._wrench, sign)
        return forces


def links_inside_boxes(world: World, data: mujoco.MjData) -> tuple[str, ...]:
    """Return the links that reach deeper into a box of the terrain than a touch does, in their order."""
    boxes = set(world.ground_geoms[1:].tolist())
    model, inside = world.model, set()
    for pair, distance in zip(data.contact.geom.tolist(), data.contact.dist.tolist(), strict=True):
        if distance < -TOUCH_DEPTH_MAX and boxes.intersection(pair):
            inside |= {int(model.geom_bodyid[geom]) for geom in pair} - {WORLD_BODY}
    return tuple(model.body(body).name for body in sorted(inside))


@compiled
def _touched(met: np.ndarray, is_world: np.ndarray) -> np.ndarray:
    """Return which geoms ``(ngeom,)`` bool met one of the world's; ``met`` ``(ngeom, ngeom)`` is not symmetric."""
    touched = np.zeros(len(is_world), dtype=np.bool_)
    for i in range(len(is_world)):
        for j in range(len(is_world)):
            if met[i, j]:
                touched[i] |= is_world[j]
                touched[j] |= is_world[i]
    return touched


@compiled
def _add_force(total: np.ndarray, frame: np.ndarray, wrench: np.ndarray, sign: float) -> None:
    """Add the force of a contact's wrench ``(6,)``, expressed in its frame, to ``total`` ``(3,)`` in W."""
    for axis in range(3):
        for row in range(3):
            total[axis] += sign * frame[3 * row + axis] * wrench[row]
