import numpy as np
import pytest
from PIL import Image

from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, BASE_POSITION
from aerial_model.values.frame import StartFrame
from aerial_model.values.terrain import Box, Terrain
from aerial_sim.picture.picture import Footage, frames, save, save_animation, strobe
from aerial_sim.picture.raycast import SUN_DIRECTION, Camera, render
from aerial_sim.picture.still_life import compose

WIDTH, HEIGHT = 96, 54  # [pixel]
TAKE_OFF, LANDING = 0.2, 0.5  # [s]
PLATFORM = Terrain(boxes=(Box(centre=[0.9, 0.0, 0.1], size=[0.6, 0.9, 0.2]),))


@pytest.fixture
def camera():
    return Camera(position=np.array([0.3, -2.0, 0.8]), target=np.array([0.0, 0.0, 0.2]), field_of_view=0.6)


def footage(robot, origin, heading):
    """A jump of 0.4 m forward, seen from a start anywhere."""
    time = np.arange(-0.1, LANDING + 1.0, 0.01)
    q = np.tile(robot.standing_configuration(), (len(time), 1))
    q[:, 0] += 0.4 * np.clip((time - TAKE_OFF) / (LANDING - TAKE_OFF), 0.0, 1.0)
    turn = rotation.about_z(heading)
    q[:, BASE_POSITION] = q[:, BASE_POSITION] @ rotation.matrix(turn).T + origin
    q[:, BASE_ORIENTATION] = rotation.multiply(turn, q[:, BASE_ORIENTATION])
    terrain = PLATFORM.placed(StartFrame(origin=origin, heading=heading))
    return Footage.of(robot, terrain, time + 7, q, start_time=7.0, take_off_time=TAKE_OFF, landing_time=LANDING)


def test_a_point_appears_where_its_ray_points(camera):
    rays = camera.rays(WIDTH, HEIGHT).reshape(HEIGHT, WIDTH, 3)
    x, y = camera.project([camera.position + 3.0 * rays[20, 70]], WIDTH, HEIGHT)[0]
    assert (x, y) == pytest.approx((70.5, 20.5))


def test_the_middle_of_the_picture_is_the_target(camera):
    np.testing.assert_allclose(camera.project([camera.target], WIDTH, HEIGHT)[0], [WIDTH / 2, HEIGHT / 2])


def test_the_robot_is_seen_where_it_stands(robot, camera):
    q = robot.standing_configuration()
    x, y = camera.project([q[:3]], WIDTH, HEIGHT)[0].astype(int)
    with_robot = render(compose(robot, Terrain(), [q]), camera, WIDTH, HEIGHT)
    q[0] += 50.0
    without = render(compose(robot, Terrain(), [q]), camera, WIDTH, HEIGHT)
    assert with_robot[y, x].max() < 0.4
    assert without[y, x].min() > 0.6


def test_a_robot_throws_a_shadow_away_from_the_sun(robot):
    above = Camera(position=np.array([0.01, 0.0, 6.0]), target=np.zeros(3), field_of_view=0.3)
    q = robot.standing_configuration()
    picture = render(compose(robot, Terrain(), [q]), above, WIDTH, WIDTH)
    sideways, up, ahead = SUN_DIRECTION  # here the picture's right is +y, and ahead is -x
    shadow = np.array([ahead, -sideways, 0.0]) / up * q[2]
    open_floor = np.array([0.55, -0.55, 0.0])  # between the lines of the grid
    x, y = above.project([shadow, open_floor], WIDTH, WIDTH).T.astype(int)
    assert picture[y[0], x[0]].mean() < 0.85 * picture[y[1], x[1]].mean()


def test_pale_poses_are_lighter(robot, camera):
    q = robot.standing_configuration()
    x, y = camera.project([q[:3]], WIDTH, HEIGHT)[0].astype(int)
    own = render(compose(robot, Terrain(), [q], [0.0]), camera, WIDTH, HEIGHT)
    pale = render(compose(robot, Terrain(), [q], [0.7]), camera, WIDTH, HEIGHT)
    assert np.all(pale[y, x] > own[y, x])


def test_the_same_motion_looks_the_same_from_any_start(robot):
    here = strobe(footage(robot, np.zeros(3), 0.0), WIDTH, HEIGHT)
    there = strobe(footage(robot, np.array([3.0, -2.0, 0.0]), 2.0), WIDTH, HEIGHT)
    assert np.mean(np.abs(here - there)) < 3e-3


def test_the_moments_begin_with_the_start_and_end_with_the_robot_at_rest(robot):
    moments = footage(robot, np.zeros(3), 0.0).moments
    assert moments[0] == 0.0
    assert moments[-1] > LANDING
    assert np.all((moments[1:-1] > TAKE_OFF) & (moments[1:-1] < LANDING))


def test_pictures_and_animations_are_written(robot, tmp_path):
    motion = footage(robot, np.zeros(3), 0.0)
    save(strobe(motion, WIDTH, HEIGHT, samples=1), tmp_path / "strobe.png")
    save_animation(frames(motion, 5.0, WIDTH, HEIGHT, samples=1), 5.0, tmp_path / "motion.gif")
    with Image.open(tmp_path / "strobe.png") as picture:
        assert picture.size == (WIDTH, HEIGHT)
    with Image.open(tmp_path / "motion.gif") as animation:
        assert animation.n_frames > 1  # equal ones are joined
        assert animation.size == (WIDTH, HEIGHT)
