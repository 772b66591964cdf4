import shutil

import numpy as np
import pytest

from aerial_model.errors import ConfigurationError
from aerial_model.robot.loading import known_robots
from aerial_model.robot.robot import Robot
from aerial_model.robot.urdf import resolved

LEG_KG = 0.54 + 0.634 + 0.064 + 2 * 0.055  # of the Mini Cheetah; the third rotor is on the trunk


@pytest.fixture
def variant(tmp_path):
    """Return a function that makes a folder with only a robot.yaml, and loads it."""

    def variant(text: str) -> Robot:
        folder = tmp_path / "variant"
        folder.mkdir(exist_ok=True)
        (folder / "robot.yaml").write_text(text)
        return Robot.load(folder)

    return variant


def test_a_variant_says_only_what_is_different(variant):
    robot = variant("name: hot\nextends: mini_cheetah\nbus_voltage: 30.0\nactuators: {knee: {torque_max: 20.0}}\n")
    original = Robot.load("mini_cheetah")
    assert robot.name == "hot"
    assert robot.actuators.bus_voltage[0] == 30.0
    knees = [j for j, name in enumerate(robot.joint_names) if "knee" in name]
    np.testing.assert_allclose(robot.actuators.torque_max[knees], 20.0)
    np.testing.assert_allclose(robot.poses["home"], original.poses["home"])
    assert robot.model_hash != original.model_hash


def test_the_total_mass_is_made_up_by_the_root_link_alone(variant):
    robot, original = variant("name: heavy\nextends: mini_cheetah\ntotal_mass: 12.0\n"), Robot.load("mini_cheetah")
    assert robot.mass == pytest.approx(12.0)
    for joint in range(2, robot.model.njoints):
        assert robot.model.inertias[joint].mass == original.model.inertias[joint].mass


def test_a_mass_that_leaves_nothing_for_the_root_link_is_refused(variant):
    with pytest.raises(ConfigurationError, match=r"total_mass: 3.0 kg leave nothing for link 'base'"):
        variant("name: light\nextends: mini_cheetah\ntotal_mass: 3.0\n")


def test_a_joint_that_is_fixed_is_none(variant):
    text = """
name: stiff
extends: mit_humanoid
fixed_joints: [r_elbow, l_elbow]
actuators: {elbow: {joints: []}}
"""
    robot = variant(text)
    assert robot.n_joints == 14
    assert robot.mass == pytest.approx(25.0)


def test_a_fixed_joint_that_is_misspelt_is_named(variant):
    with pytest.raises(ConfigurationError, match=r"no joint 'r_elbw'.*did you mean 'r_elbow'"):
        variant("name: stiff\nextends: mit_humanoid\nfixed_joints: [r_elbw]\n")


def test_a_robot_does_not_extend_itself(variant, tmp_path):
    with pytest.raises(ConfigurationError, match="extends itself"):
        variant("name: loop\nextends: ../variant\n")


@pytest.mark.parametrize("parent", ["mini_cheeta", "../nowhere", "3"])
def test_what_is_extended_must_exist(variant, parent):
    with pytest.raises(ConfigurationError, match=r"no robot|expected a robot's name"):
        variant(f"name: orphan\nextends: {parent}\n")


def test_a_urdf_may_lie_elsewhere(tmp_path):
    shutil.copytree(known_robots()["mini_cheetah"], tmp_path / "robot")
    (tmp_path / "robot" / "robot.urdf").rename(tmp_path / "other.urdf")
    yaml = tmp_path / "robot" / "robot.yaml"
    yaml.write_text("urdf: ../other.urdf\n" + yaml.read_text())
    assert Robot.load(tmp_path / "robot").mass == Robot.load("mini_cheetah").mass


def test_a_joint_without_stops_gets_some_far_away(tmp_path):
    folder = shutil.copytree(known_robots()["mini_cheetah"], tmp_path / "robot")
    urdf = folder / "robot.urdf"
    urdf.write_text(urdf.read_text().replace('name="fr_hip" type="revolute"', 'name="fr_hip" type="continuous"'))
    robot = Robot.load(folder)
    j = robot.joint_names.index("fr_hip")
    assert robot.model.upperPositionLimit[7 + j] > 2 * np.pi


def test_a_package_is_found_where_ros_says(tmp_path, monkeypatch):
    file = tmp_path / "ws" / "share" / "some_description" / "meshes" / "leg.stl"
    file.parent.mkdir(parents=True)
    file.touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ws"))
    assert resolved("package://some_description/meshes/leg.stl", tmp_path / "elsewhere") == file
