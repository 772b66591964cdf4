"""A robot in several poses at once, on its terrain, as motionless shapes to be looked at."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from aerial_model.robot.robot import Robot
from aerial_model.values.terrain import Terrain
from aerial_sim.world.world import ROBOT_LOOKS_GROUP, ROBOT_SHAPE_GROUP, build

FLOOR = 0  # id of the floor's shape; boxes and robots follow
_ANY_DT = 0.001  # [s] nothing moves here


@dataclass(frozen=True, kw_only=True, eq=False)
class StillLife:
    """Shapes fixed to the world, as a MuJoCo model: its ray queries are fastest on these."""

    model: mujoco.MjModel
    colours: np.ndarray  # (ngeom, 3) as displayed, 0 … 1
    centre: np.ndarray  # (3,) of a sphere around all shapes but the floor, in W [m] …
    radius: float  # … and its radius [m]


def compose(robot: Robot, terrain: Terrain, poses: list[np.ndarray], paleness: list[float] | None = None) -> StillLife:
    """Return a robot's looks in ``poses``, each q ``(nq,)`` in W, on ``terrain`` in W.

    Args:
        robot: whose looks are shown; a robot without visual shapes shows what it collides with.
        terrain: in W.
        poses: at least one.
        paleness: of each pose, from 0, its own colours, to 1, white.
    """
    world = build(robot, terrain, _ANY_DT)
    model, data = world.model, mujoco.MjData(world.model)
    still = mujoco.MjSpec()
    meshes = _copy_meshes(model, still)
    colours: list[np.ndarray] = []
    mujoco.mj_fwdPosition(model, data)
    for geom in world.ground_geoms:
        _add_shape(still, model, data, geom, meshes)
        colours.append(_colour(model, geom))
    looks = _looks(model)
    for q, pale in zip(poses, paleness or [0.0] * len(poses), strict=True):
        data.qpos[:] = world.qpos(q)
        mujoco.mj_fwdPosition(model, data)
        for geom in looks:
            _add_shape(still, model, data, geom, meshes)
            colours.append((1 - pale) * _colour(model, geom) + pale)
    compiled = still.compile()
    positions, reach = compiled.geom_pos[FLOOR + 1 :], compiled.geom_rbound[FLOOR + 1 :]
    low, high = (positions - reach[:, None]).min(axis=0), (positions + reach[:, None]).max(axis=0)
    return StillLife(
        model=compiled,
        colours=np.array(colours),
        centre=(low + high) / 2,
        radius=float(np.linalg.norm(high - low) / 2),
    )


def _looks(model: mujoco.MjModel) -> np.ndarray:
    shown = np.flatnonzero(model.geom_group == ROBOT_LOOKS_GROUP)
    return shown if len(shown) else np.flatnonzero(model.geom_group == ROBOT_SHAPE_GROUP)


def _colour(model: mujoco.MjModel, geom: int) -> np.ndarray:
    material = model.geom_matid[geom]
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    return rgba[:3].astype(float)


def _copy_meshes(model: mujoco.MjModel, still: mujoco.MjSpec) -> dict[int, str]:
    """Add the meshes of ``model`` to ``still`` and return their names by id."""
    names = {}
    for mesh in range(model.nmesh):
        vertices = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
        faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
        names[mesh] = f"mesh {mesh}"
        still.add_mesh(
            name=names[mesh],
            uservert=model.mesh_vert[vertices].ravel(),
            userface=model.mesh_face[faces].ravel(),
        )
    return names


def _add_shape(
    still: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData, geom: int, meshes: dict[int, str]
) -> None:
    orientation = np.empty(4)
    mujoco.mju_mat2Quat(orientation, data.geom_xmat[geom])
    shape = still.worldbody.add_geom(type=model.geom_type[geom], pos=data.geom_xpos[geom], quat=orientation)
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        shape.meshname = meshes[int(model.geom_dataid[geom])]
    else:
        shape.size = model.geom_size[geom]
