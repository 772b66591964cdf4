import dataclasses

import numpy as np
import pytest

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.robot.robot import BASE_POSITION, JOINT_POSITION
from aerial_model.values.terrain import Terrain
from aerial_planner.assembly.collision import CollisionModel

from ..conftest import jump

PLATFORM = Terrain.platform(0.16, 0.3, 0.0)


@pytest.fixture(scope="module")
def collisions(robot):
    return CollisionModel(robot)


def held(plan, q):
    """Return the plan with one configuration throughout."""
    return dataclasses.replace(plan, q=np.tile(q, (len(plan.time), 1)))


def test_a_checked_plan_touches_nothing(collisions, forward):
    assert collisions.first_touch(forward.plan) is None


def test_a_trunk_in_the_ground_is_found(collisions, forward, robot):
    q = robot.standing_configuration()
    q[2] = 0.04
    touch = collisions.first_touch(held(forward.plan, q))
    assert touch.is_terrain
    assert touch.time == 0.0


def test_a_robot_that_stands_in_a_platform_is_found(collisions, forward, robot):
    q = robot.standing_configuration()
    plan = dataclasses.replace(held(forward.plan, q), terrain=PLATFORM)
    assert collisions.first_touch(plan) is None
    q[BASE_POSITION] += [0.15, 0.0, 0.0]
    assert collisions.first_touch(dataclasses.replace(held(forward.plan, q), terrain=PLATFORM)).is_terrain


def test_a_shank_in_the_trunk_is_found_by_name(collisions, forward, robot):
    q = robot.standing_configuration()
    q[BASE_POSITION] += [0.0, 0.0, 1.0]
    q[JOINT_POSITION] = robot.poses["home"]
    i = robot.joint_names.index("fl_abad")
    q[JOINT_POSITION][i : i + 3] = [-1.4, -1.2, 2.65]
    touch = collisions.first_touch(held(forward.plan, q))
    assert not touch.is_terrain
    assert "fl_" in str(touch)


def test_links_that_meet_in_the_home_pose_are_no_pair(collisions, forward, robot):
    assert collisions.first_touch(held(forward.plan, robot.standing_configuration())) is None


def test_landing_with_shanks_over_the_edge_jumped_off_is_refused(planner):
    with pytest.raises(RefusalError, match=r"platform edge: h[lr]_shank would touch the terrain") as refusal:
        planner.plan(jump(0.5, 0.0, -0.1, terrain=Terrain.platform(-0.1, 0.25, 0.0)))
    assert refusal.value.code is RefusalCode.CHECK_FAILED
