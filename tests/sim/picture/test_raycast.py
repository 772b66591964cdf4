"""The ray caster against what geometry says of simple scenes."""

import mujoco
import numpy as np
import pytest

from aerial_sim.picture.raycast import BACKGROUND, GAMMA, Camera, render
from aerial_sim.picture.still_life import StillLife

SIDE = 40  # of the pictures [pixel]
RED, GREY = [0.9, 0.1, 0.1], [0.8, 0.8, 0.8]


def scene_of(*, radius, height):
    """A red ball above a grey floor."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0], pos=[0, 0, height])
    return StillLife(
        model=spec.compile(), colours=np.array([GREY, RED]), centre=np.array([0.0, 0.0, height]), radius=radius
    )


@pytest.fixture
def camera():
    """A camera 4 m in front of the ball, level with it."""
    return Camera(position=np.array([0.0, -4.0, 1.0]), target=np.array([0.0, 0.0, 1.0]), field_of_view=0.5)


def is_red(picture):
    return picture[..., 0] > 2 * picture[..., 1]


def test_axes_are_a_right_handed_frame_that_keeps_the_vertical(camera):
    right, up, forward = camera.axes
    np.testing.assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(right, up), -forward, atol=1e-12)
    assert right[2] == 0.0


def test_rays_are_unit_vectors_that_span_the_field_of_view(camera):
    rays = camera.rays(SIDE, SIDE).reshape(SIDE, SIDE, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1.0)
    top, bottom = rays[0, SIDE // 2], rays[-1, SIDE // 2]
    expected = 2 * np.arctan(np.tan(0.25) * (SIDE - 1) / SIDE)  # from centre to centre of the outermost pixels
    assert np.arccos(top @ bottom) == pytest.approx(expected, rel=1e-3)


def test_a_ball_covers_the_share_of_the_picture_that_its_size_says(camera):
    radius = 0.4
    picture = render(scene_of(radius=radius, height=1.0), camera, SIDE, SIDE, samples=1)
    seen_at = np.tan(np.arcsin(radius / 4.0)) / np.tan(0.25) * SIDE / 2  # radius of its outline [pixel]
    assert is_red(picture).sum() == pytest.approx(np.pi * seen_at**2, rel=0.05)


def test_a_ball_is_brighter_on_top_than_below(camera):
    picture = render(scene_of(radius=0.4, height=1.0), camera, SIDE, SIDE)
    red = np.flatnonzero(is_red(picture)[:, SIDE // 2])
    assert picture[red[1], SIDE // 2].mean() > picture[red[-2], SIDE // 2].mean()


def test_above_the_horizon_there_is_the_background(camera):
    picture = render(scene_of(radius=0.1, height=1.0), camera, SIDE, SIDE)
    np.testing.assert_allclose(picture[0, 0], BACKGROUND ** (1 / GAMMA), atol=1e-6)
