"""A still life has the shapes of the world it is made from, where they are there."""

import mujoco
import numpy as np
import pytest

from aerial_model.values.terrain import Box, Terrain
from aerial_sim.conditions import PHYSICS_STEP
from aerial_sim.picture.still_life import FLOOR, compose
from aerial_sim.world.world import ROBOT_LOOKS_GROUP, build

BOX = Box(centre=[0.9, 0.2, 0.1], size=[0.6, 0.9, 0.2], yaw=0.4)
POSITION_TOLERANCE = 1e-6  # [m]


@pytest.fixture
def looks(robot):
    """Positions of the robot's visual shapes in a pose ``(k, 3)`` [m]: ``looks(q)``."""
    world = build(robot, Terrain(), PHYSICS_STEP)
    data = mujoco.MjData(world.model)

    def looks(q):
        data.qpos[:] = world.qpos(q)
        mujoco.mj_fwdPosition(world.model, data)
        return data.geom_xpos[world.model.geom_group == ROBOT_LOOKS_GROUP].copy()

    return looks


def test_the_ground_comes_first_and_lies_where_the_terrain_says(robot):
    scene = compose(robot, Terrain(boxes=(BOX,)), [robot.standing_configuration()])
    assert scene.model.geom_type[FLOOR] == mujoco.mjtGeom.mjGEOM_PLANE
    np.testing.assert_allclose(scene.model.geom_pos[FLOOR + 1], BOX.centre)
    np.testing.assert_allclose(scene.model.geom_size[FLOOR + 1], BOX.size / 2)


def test_every_pose_is_there_with_all_its_shapes(robot, looks):
    q_0 = robot.standing_configuration()
    q_1 = q_0.copy()
    q_1[:3] += [1.0, 0.5, 0.3]
    scene = compose(robot, Terrain(), [q_0, q_1])
    expected = np.concatenate([looks(q_0), looks(q_1)])
    assert len(scene.colours) == scene.model.ngeom == 1 + len(expected)
    shift = scene.model.geom_pos[1 + len(expected) // 2 :] - scene.model.geom_pos[1 : 1 + len(expected) // 2]
    np.testing.assert_allclose(shift, np.tile([1.0, 0.5, 0.3], (len(expected) // 2, 1)), atol=POSITION_TOLERANCE)


def test_paleness_goes_from_the_own_colour_to_white(robot):
    q = robot.standing_configuration()
    own, half, white = (compose(robot, Terrain(), [q], [pale]).colours[1:] for pale in (0.0, 0.5, 1.0))
    np.testing.assert_allclose(half, (own + 1.0) / 2)
    np.testing.assert_allclose(white, 1.0)


def test_the_sphere_around_the_scene_holds_every_pose(robot, looks):
    q = robot.standing_configuration()
    far = q.copy()
    far[0] += 3.0
    scene = compose(robot, Terrain(), [q, far])
    points = np.concatenate([looks(q), looks(far)])
    assert np.linalg.norm(points - scene.centre, axis=1).max() <= scene.radius
