import numpy as np
import pytest

from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, BASE_POSITION
from aerial_model.values.frame import StartFrame
from aerial_model.values.terrain import GAP_DEPTH, Box, Terrain
from aerial_sim.world.placement import ground_shift, placed

AHEAD = Terrain(boxes=(Box(centre=[0.8, 0.0, 0.1], size=[0.6, 0.9, 0.2]),))
POINTS = np.random.default_rng(0).uniform(-1.5, 1.5, size=(300, 2))  # where heights are compared [m]


@pytest.fixture
def standing(robot):
    """A robot at home, its support centre at a place, with a heading."""

    def standing(origin, heading):
        q = robot.standing_configuration()
        turn = rotation.about_z(heading)
        q[BASE_POSITION] = rotation.matrix(turn) @ q[BASE_POSITION] + origin
        q[BASE_ORIENTATION] = turn
        return q

    return standing


def test_requested_boxes_stand_ahead_of_the_robot(robot, standing):
    terrain = placed(robot, standing([1.0, 2.0, 0.0], np.pi / 2), Terrain(), AHEAD)
    assert len(terrain.boxes) == 1
    np.testing.assert_allclose(terrain.boxes[0].centre, [1.0, 2.8, 0.1], atol=1e-9)
    assert terrain.boxes[0].yaw == pytest.approx(np.pi / 2)


def test_old_boxes_go(robot, standing):
    far = Terrain(boxes=(Box(centre=[5.0, 0.0, 0.1], size=[0.6, 0.9, 0.2]),))
    assert placed(robot, standing([0.0, 0.0, 0.0], 0.0), far, Terrain()).boxes == ()


def test_the_box_under_the_robot_stays_and_new_ones_build_on_its_height(robot, standing):
    under = Terrain(boxes=(Box(centre=[0.0, 0.0, 0.1], size=[0.9, 0.9, 0.2]),))
    terrain = placed(robot, standing([0.0, 0.0, 0.2], 0.0), under, AHEAD)
    assert terrain.boxes[0] is under.boxes[0]
    assert terrain.boxes[1].top == pytest.approx(0.4)
    assert terrain.floor == pytest.approx(0.0)


def test_a_box_the_robot_only_overhangs_goes(robot, standing):
    low = Terrain(boxes=(Box(centre=[0.0, 0.0, 0.05], size=[0.1, 0.1, 0.1]),))
    assert placed(robot, standing([0.0, 0.0, 0.0], 0.0), low, Terrain()).boxes == ()


def test_a_terrain_that_falls_away_replaces_what_the_robot_stands_on(robot, standing):
    under = Terrain(boxes=(Box(centre=[0.3, 0.0, 0.1], size=[0.9, 0.9, 0.2]),))
    step_down = Terrain(boxes=(Box(centre=[0.0, 0.0, -0.1], size=[0.9, 0.9, 0.2]),))
    terrain = placed(robot, standing([0.0, 0.0, 0.2], 0.0), under, step_down)
    assert len(terrain.boxes) == 1
    np.testing.assert_allclose(terrain.boxes[0].centre, [0.0, 0.0, 0.1], atol=1e-9)
    assert terrain.floor == pytest.approx(0.0)


def test_a_gap_opens_in_the_floor_and_the_floor_stays_down(robot, standing):
    q = standing([0.0, 0.0, 0.0], 0.0)
    gap = placed(robot, q, Terrain(), Terrain.gap(0.2, 0.3, 0.0))
    np.testing.assert_allclose(gap.height(np.array([[0.29, 0], [0.4, 0], [0.51, 0]])), [0, -GAP_DEPTH, 0], atol=1e-9)
    afterwards = placed(robot, q, gap, Terrain())
    assert len(afterwards.boxes) == 1
    assert afterwards.floor == pytest.approx(-GAP_DEPTH)


@pytest.mark.parametrize("terrain", [Terrain.platform(0.16, 0.35, 0.0), Terrain.hurdle(0.1, 0.4, 0.3), Terrain()])
@pytest.mark.parametrize("level", [0.0, 0.3])
def test_what_rises_ahead_lies_as_high_above_the_feet_as_requested(robot, standing, terrain, level):
    """Compared with the plain placing of a terrain in the start heading frame: the floor may lie deeper, nothing else."""
    origin, heading = [1.0, 2.0, level], 0.7
    under = Terrain(boxes=(Box(centre=[1.0, 2.0, level / 2], size=[0.6, 0.6, level]),)) if level else Terrain()
    world = placed(robot, standing(origin, heading), under, terrain)
    expected = terrain.placed(StartFrame(origin=np.array(origin), heading=heading))
    above = expected.height(POINTS + origin[:2]) > level + 1e-9
    np.testing.assert_allclose(
        world.height(POINTS + origin[:2])[above], expected.height(POINTS + origin[:2])[above], atol=1e-9
    )
    assert ground_shift(robot, standing(origin, heading), under, world) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("terrain", [Terrain.platform(-0.16, 0.3, 0.0), Terrain.gap(0.2, 0.3, 0.4)])
def test_what_falls_away_is_as_requested_and_bears_the_robot(robot, standing, terrain):
    q = standing([1.0, 2.0, 0.0], 0.7)
    world = placed(robot, q, Terrain(), terrain)
    expected = terrain.placed(StartFrame.of(robot, q))
    np.testing.assert_allclose(world.height(POINTS), expected.height(POINTS), atol=1e-9)
    assert ground_shift(robot, q, Terrain(), world) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("change", [-0.1, 0.05])
def test_ground_that_moves_under_the_feet_is_measured(robot, standing, change):
    q = standing([0.0, 0.0, 0.0], 0.0)
    assert ground_shift(robot, q, Terrain(), Terrain(base=change)) == pytest.approx(change)


def test_feet_in_the_air_lose_no_ground(robot, standing):
    assert ground_shift(robot, standing([0.0, 0.0, 0.5], 0.0), Terrain(), Terrain(base=-0.2)) == 0.0
