import numpy as np
import pytest

from aerial_model.values.frame import StartFrame
from aerial_model.values.terrain import GAP_DEPTH, Box, Terrain


def test_a_platform_is_high_behind_its_near_edge_and_the_floor_before_it():
    terrain = Terrain.platform(0.16, 0.3, 0.0)
    np.testing.assert_allclose(terrain.height(np.array([[0.29, 0.0], [0.31, 0.0], [1.3, 0.0]])), [0.0, 0.16, 0.0])


def test_a_platform_lies_in_the_direction_of_the_jump():
    terrain = Terrain.platform(0.1, 0.3, np.pi / 2)
    np.testing.assert_allclose(terrain.height(np.array([[0.0, 0.5], [0.5, 0.0]])), [0.1, 0.0])


def test_a_step_down_has_the_start_at_zero_and_the_floor_below():
    terrain = Terrain.platform(-0.16, 0.3, 0.0)
    np.testing.assert_allclose(terrain.height(np.array([[0.0, 0.0], [0.29, 0.0], [0.31, 0.0]])), [0.0, 0.0, -0.16])


@pytest.mark.parametrize("height", [-0.1, 0.0, 0.1])
def test_a_gap_is_deep_between_its_banks(height):
    terrain = Terrain.gap(0.3, 0.25, 0.0, height)
    points = np.array([[0.0, 0.0], [0.24, 0.0], [0.26, 0.0], [0.54, 0.0], [0.56, 0.0]])
    np.testing.assert_allclose(terrain.height(points), [0.0, 0.0, -GAP_DEPTH, -GAP_DEPTH, height], atol=1e-12)


def test_the_floor_of_a_placed_terrain_keeps_its_distance():
    for terrain in (Terrain(), Terrain.platform(0.2, 0.3, 0.0), Terrain.gap(0.3, 0.25, 0.0)):
        assert terrain.placed(StartFrame(origin=np.array([0.0, 0.0, 0.5]), heading=0.3)).floor == pytest.approx(
            0.5 + terrain.floor
        )


def test_a_placed_terrain_has_the_same_heights_at_the_moved_points():
    terrain = Terrain.platform(0.16, 0.3, 0.4)
    origin, yaw = np.array([1.0, -2.0, 0.5]), 0.7
    points = np.random.default_rng(0).uniform(-1, 2, size=(200, 2))
    c, s = np.cos(yaw), np.sin(yaw)
    moved = points @ np.array([[c, s], [-s, c]]) + origin[:2]
    over_box = terrain.boxes[0].covers(points)
    np.testing.assert_array_equal(
        terrain.placed(StartFrame(origin=origin, heading=yaw)).boxes[0].covers(moved), over_box
    )
    assert terrain.placed(StartFrame(origin=origin, heading=yaw)).boxes[0].top == pytest.approx(0.66)


@pytest.mark.parametrize("size", [[0.0, 1.0, 1.0], [1.0, -1.0, 1.0]])
def test_a_box_without_extent_is_refused(size):
    with pytest.raises(ValueError, match="positive side lengths"):
        Box(centre=np.zeros(3), size=np.array(size))


def test_a_box_that_is_no_number_is_refused():
    with pytest.raises(Exception, match="finite"):
        Box(centre=np.array([np.nan, 0, 0]), size=np.ones(3))
