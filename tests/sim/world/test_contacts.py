"""Who touches the world, against figures that a scene of one robot on boxes has by construction."""

import mujoco
import numpy as np
import pytest

from aerial_model.values.terrain import Box, Terrain
from aerial_sim.conditions import PHYSICS_STEP
from aerial_sim.world.contacts import TOUCH_DEPTH_MAX, ContactSensing, links_inside_boxes
from aerial_sim.world.world import build

PILLAR = Box(centre=[0.0, 0.0, 0.2], size=[0.1, 0.1, 0.4])  # under and into the trunk


@pytest.fixture
def scene(robot):
    """Make a world with the robot at home, ``lift`` [m] higher: ``scene(boxes, lift)`` gives world and data."""

    def scene(boxes=(), lift=0.0):
        world = build(robot, Terrain(boxes=tuple(boxes)), PHYSICS_STEP)
        data = mujoco.MjData(world.model)
        q = robot.standing_configuration()
        q[2] += lift
        data.qpos[:] = world.qpos(q)
        mujoco.mj_forward(world.model, data)
        return world, data

    return scene


def sensing_of(world, data):
    contacts = ContactSensing(world)
    contacts.collect(data)
    return contacts


def test_feet_that_reach_into_the_floor_touch_it_and_bear_the_robot_upwards(scene):
    world, data = scene(lift=-1e-4)
    contacts = sensing_of(world, data)
    assert contacts.points.all()
    forces = contacts.forces(data)
    vertical = forces[:, 2].sum()
    constraint = data.qfrc_constraint[2]  # on the free base, in W: what the world gives as a whole
    assert vertical > 0
    assert vertical == pytest.approx(constraint, rel=1e-9)


def test_a_robot_in_the_air_touches_nothing(scene):
    world, data = scene(lift=0.1)
    contacts = sensing_of(world, data)
    assert not contacts.points.any()
    assert contacts.other_links == ()
    np.testing.assert_array_equal(contacts.forces(data), 0.0)


def test_a_box_under_one_foot_is_touched_by_that_foot_alone(scene, robot):
    foot = robot.contact_positions(robot.standing_configuration())[0]
    height = 0.1  # [m]
    stone = Box(centre=[foot[0], foot[1], height / 2], size=[0.05, 0.05, height])
    world, data = scene([stone], lift=height - 1e-4)
    np.testing.assert_array_equal(sensing_of(world, data).points, [True, False, False, False])


def test_touches_add_up_until_they_are_cleared(scene):
    world, data = scene(lift=-1e-4)
    contacts = sensing_of(world, data)
    data.qpos[2] += 0.1
    mujoco.mj_forward(world.model, data)
    contacts.collect(data)
    assert contacts.points.all()
    contacts.clear()
    contacts.collect(data)
    assert not contacts.points.any()


def test_a_link_inside_a_box_is_named(scene):
    world, data = scene([PILLAR])
    assert links_inside_boxes(world, data) == ("base",)


@pytest.mark.parametrize("lift", [0.0, -2 * TOUCH_DEPTH_MAX])
def test_the_floor_is_no_box(scene, lift):
    world, data = scene(lift=lift)
    assert links_inside_boxes(world, data) == ()
