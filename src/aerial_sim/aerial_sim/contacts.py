"""Who touches the world, and how hard, read from MuJoCo's contact list."""

from __future__ import annotations

import mujoco
import numpy as np

from aerial_sim.world import WORLD_BODY, World


class ContactSensing:
    """Collects the touches of one control period; only touches of the world count, not of the robot by itself."""

    def __init__(self, world: World) -> None:
        model = world.model
        self._world = world
        self._is_world = model.geom_bodyid == WORLD_BODY  # (ngeom,)
        self._is_point = np.zeros(model.ngeom, dtype=bool)
        self._is_point[world.contact_geoms] = True
        self._met = np.zeros((model.ngeom, model.ngeom), dtype=bool)  # which pairs touched, in MuJoCo's order
        self._wrench = np.zeros(6)

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
        return self._met[self._is_world].any(axis=0) | self._met[:, self._is_world].any(axis=1)

    @property
    def points(self) -> np.ndarray:
        """Contact points that touched the world ``(n_c,)`` bool."""
        return self._touched[self._world.contact_geoms]

    @property
    def other_links(self) -> tuple[str, ...]:
        """Links that touched the world elsewhere than at a contact point."""
        others = np.flatnonzero(self._touched & ~self._is_point)
        model = self._world.model
        return tuple(model.body(body).name for body in np.unique(model.geom_bodyid[others]))

    def forces(self, data: mujoco.MjData) -> np.ndarray:
        """Return the force of the world on each contact point in the last physics step ``(n_c, 3)`` [N] in W."""
        forces = np.zeros((len(self._world.contact_geoms), 3))
        index = {geom: i for i, geom in enumerate(self._world.contact_geoms.tolist())}
        for k, (first, second) in enumerate(data.contact.geom.tolist()):
            point, other, sign = (second, first, 1.0) if second in index else (first, second, -1.0)
            if point not in index or not self._is_world[other]:
                continue
            mujoco.mj_contactForce(self._world.model, data, k, self._wrench)
            frame = data.contact.frame[k].reshape(3, 3)  # rows: normal (from first to second geom), two tangents, in W
            forces[index[point]] += sign * (frame.T @ self._wrench[:3])
        return forces
