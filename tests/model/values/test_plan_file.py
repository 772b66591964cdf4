import dataclasses

import numpy as np
import pytest

from aerial_model.errors import ConfigurationError, InvalidPlanError
from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Ending, Plan
from aerial_model.values.plan_file import load_plan, save_plan
from aerial_model.values.terrain import Box, Terrain

K = 3


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture
def plan(robot):
    random = np.random.default_rng(0)
    n_c, nv = robot.n_contacts, robot.model.nv
    return Plan(
        motion="jump",
        robot=robot.name,
        model_hash=robot.model_hash,
        time=np.array([0.0, 0.3, 0.6]),
        q=np.tile(robot.standing_configuration(), (K, 1)),
        v=random.normal(size=(K, nv)),
        com=random.normal(size=(K, 3)),
        com_velocity=random.normal(size=(K, 3)),
        angular_momentum=random.normal(size=(K, 3)),
        foot_position=random.normal(size=(K, n_c, 3)),
        force=random.normal(size=(K, n_c, 3)),
        contact=random.random((K, n_c)) < 0.5,
        take_off_time=0.3,
        landing_time=0.6,
        landing_joint_position=robot.poses["landing"],
        landing_com_height=0.25,
        landing_support_centre=np.array([0.6, 0.0, 0.2]),
        landing_yaw=0.1,
        rotation=np.array([0.0, 0.0, 0.1]),
        terrain=Terrain(boxes=(Box(centre=np.array([0.8, 0.0, 0.1]), size=np.array([0.9, 0.8, 0.2]), yaw=0.1),)),
        request_id="7",
    ).checked(robot)


def test_a_loaded_plan_is_the_saved_one_to_the_last_bit(plan, robot, tmp_path):
    save_plan(plan, tmp_path / "jump.plan")
    loaded = load_plan(tmp_path / "jump.plan", robot)
    np.testing.assert_equal(dataclasses.asdict(loaded), dataclasses.asdict(plan))


def test_flat_ground_is_kept_flat(plan, robot, tmp_path):
    save_plan(dataclasses.replace(plan, terrain=Terrain()), tmp_path / "plan")
    assert load_plan(tmp_path / "plan", robot).terrain == Terrain()


def test_a_plan_for_another_robot_is_not_loaded(plan, robot, tmp_path):
    save_plan(plan, tmp_path / "plan")
    with pytest.raises(InvalidPlanError, match="this one is"):
        load_plan(tmp_path / "plan", dataclasses.replace(robot, model_hash="other"))


def test_a_file_of_another_format_is_named_as_such(plan, robot, tmp_path):
    save_plan(plan, tmp_path / "plan.npz")
    entries = {**np.load(tmp_path / "plan.npz"), "format": 99}
    np.savez(tmp_path / "plan.npz", **entries)
    with pytest.raises(InvalidPlanError, match="format 99; this version reads 1 and 2"):
        load_plan(tmp_path / "plan.npz", robot)


def test_a_plan_of_the_first_format_ended_in_a_stand(plan, robot, tmp_path):
    save_plan(plan, tmp_path / "plan.npz")
    entries = {name: entry for name, entry in np.load(tmp_path / "plan.npz").items() if name != "ending"}
    np.savez(tmp_path / "plan.npz", **{**entries, "format": 1})
    assert load_plan(tmp_path / "plan.npz", robot).ending is Ending.STAND


def test_an_unknown_ending_is_named(plan, robot, tmp_path):
    save_plan(plan, tmp_path / "plan.npz")
    np.savez(tmp_path / "plan.npz", **{**np.load(tmp_path / "plan.npz"), "ending": "handstand"})
    with pytest.raises(InvalidPlanError, match="unknown ending 'handstand'; known: stand"):
        load_plan(tmp_path / "plan.npz", robot)


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04 cut off"])
def test_anything_else_is_no_plan_file(content, robot, tmp_path):
    (tmp_path / "plan").write_bytes(content)
    with pytest.raises(InvalidPlanError, match="not a plan file"):
        load_plan(tmp_path / "plan", robot)


def test_damage_anywhere_is_one_sentence_or_harmless(plan, robot, tmp_path):
    path = tmp_path / "plan"
    save_plan(plan, path)
    whole, random = path.read_bytes(), np.random.default_rng(0)
    sentences = []
    for _ in range(200):
        damaged = bytearray(whole)
        damaged[random.integers(len(damaged))] ^= random.integers(1, 256)
        path.write_bytes(damaged)
        try:
            load_plan(path, robot)
        except InvalidPlanError as error:
            sentences.append(str(error))
    assert len(sentences) > 100
    assert all(sentence.startswith(f"{path}: ") and "\n" not in sentence for sentence in sentences)


@pytest.mark.parametrize(
    ("name", "value"),
    [("motion", 3.0), ("take_off_time", "soon"), ("q", np.array([["x"]])), ("landing_yaw", np.zeros(2)), ("com", 1.0)],
)
def test_an_entry_of_another_kind_is_named(plan, robot, tmp_path, name, value):
    save_plan(plan, tmp_path / "plan.npz")
    np.savez(tmp_path / "plan.npz", **{**np.load(tmp_path / "plan.npz"), name: value})
    with pytest.raises(InvalidPlanError, match=f"plan field {name}: expected"):
        load_plan(tmp_path / "plan.npz", robot)


def test_a_missing_file_is_no_plan_file(robot, tmp_path):
    with pytest.raises(InvalidPlanError, match="not a plan file"):
        load_plan(tmp_path / "plan", robot)


def test_an_archive_of_something_else_is_no_plan_file(robot, tmp_path):
    np.savez(tmp_path / "plan.npz", format=1, time=np.zeros(3))
    with pytest.raises(InvalidPlanError, match="not a plan file"):
        load_plan(tmp_path / "plan.npz", robot)


def test_a_place_that_cannot_be_written_is_named(plan, tmp_path):
    with pytest.raises(ConfigurationError, match="cannot be written"):
        save_plan(plan, tmp_path / "missing" / "plan")
