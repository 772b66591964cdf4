import shutil
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml

from aerial_model.errors import ConfigurationError
from aerial_model.robot.loading import known_robots
from aerial_model.robot.robot import Robot
from aerial_model.values.frame import StartFrame

MINI_CHEETAH = known_robots()["mini_cheetah"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return shutil.copytree(MINI_CHEETAH, tmp_path / "robot")


def edit(folder: Path, change) -> None:
    path = folder / "robot.yaml"
    data = yaml.safe_load(path.read_text())
    change(data)
    path.write_text(yaml.safe_dump(data))


def test_the_mini_cheetah_weighs_what_its_parts_weigh():
    assert Robot.load("mini_cheetah").mass == pytest.approx(3.3 + 4 * (0.54 + 0.634 + 0.064) + 12 * 0.055)


def test_it_stands_with_its_feet_on_the_ground_around_the_origin():
    robot = Robot.load("mini_cheetah")
    feet = robot.contact_positions(robot.standing_configuration())
    np.testing.assert_allclose(feet[:, 2], 0.004, atol=1e-9)
    np.testing.assert_allclose(feet[:, :2].mean(axis=0), 0.0, atol=1e-12)


def test_left_and_right_mirror_each_other():
    robot = Robot.load("mini_cheetah")
    fr, fl, hr, hl = robot.contact_positions(robot.standing_configuration())
    mirror = np.array([1.0, -1.0, 1.0])
    np.testing.assert_allclose(fr * mirror, fl, atol=1e-12)
    np.testing.assert_allclose(hr * mirror, hl, atol=1e-12)


def test_the_start_frame_stands_on_the_ground_under_the_support_and_looks_ahead():
    robot = Robot.load("mini_cheetah")
    frame = StartFrame.of(robot, robot.standing_configuration())
    origin, yaw = frame.origin, frame.heading
    np.testing.assert_allclose(origin, 0.0, atol=1e-9)
    assert yaw == 0.0


def test_a_folder_loads_like_the_robot_it_was_copied_from(folder):
    assert Robot.load(folder).model_hash == Robot.load("mini_cheetah").model_hash


@pytest.mark.parametrize("key", ["name", "contact_points", "bus_voltage", "actuators", "poses"])
def test_a_missing_key_is_named(folder, key):
    edit(folder, lambda data: data.pop(key))
    with pytest.raises(ConfigurationError, match=f"key '{key}' is missing"):
        Robot.load(folder)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda d: d.update(bus_volts=24), "unknown key 'bus_volts'.*did you mean 'bus_voltage'"),
        (lambda d: d["actuators"]["knee"].pop("gear_ratio"), "actuators: knee: key 'gear_ratio' is missing"),
        (lambda d: d["actuators"]["knee"].update(resistance=-1), "resistance must be positive"),
        (lambda d: d["actuators"]["knee"].update(torque_max="much"), "torque_max: expected a finite number"),
        (lambda d: d["actuators"]["knee"]["joints"].append("fl_kne"), "no joint 'fl_kne'.*did you mean 'fl_knee'"),
        (lambda d: d["actuators"]["knee"]["joints"].pop(), "no entry for joint"),
        (lambda d: d["contact_points"][0].update(frame="foot"), "no link 'foot'"),
        (lambda d: d["contact_points"][0].update(radius=0), "radius must be positive"),
        (lambda d: d["contact_points"][1].update(name="fr"), "names must differ"),
        (lambda d: d.update(contact_points=[]), "expected a list of points"),
        (lambda d: d["poses"].pop("home"), "poses: 'home' is missing"),
        (lambda d: d["poses"]["home"].pop("hip"), "no value for joint"),
        (lambda d: d["poses"]["home"].update(elbow=1.0), "unknown joint or kind 'elbow'"),
        (lambda d: d["poses"]["home"].update(hip=float("nan")), "expected finite numbers"),
        (lambda d: d["planning_range"].update(hip=[1.0, -1.0]), "must be the smaller one"),
        (lambda d: d.update(frozen_joints=["x"]), "frozen_joints: the URDF has no joint 'x'"),
        (lambda d: d.update(held_joints=["fl_kne"]), "held_joints: the URDF has no joint 'fl_kne'.*did you mean"),
        (lambda d: d.update(held_joints="fl_knee"), "held_joints: expected a list of joints"),
        (lambda d: d.update(frozen_joints=["fl_hip", "fl_hip"]), "joint 'fl_hip' is listed twice"),
        (lambda d: d.update(held_joints=["fl_knee"]), "joint 'fl_knee' carries contact point 'fl'"),
        (lambda d: d.update(friction_coefficient=0), "expected a positive number"),
        (lambda d: d.update(bus_voltage="24 V"), "bus_voltage: expected a positive number"),
    ],
)
def test_bad_data_gets_a_sentence_that_names_it(folder, change, sentence):
    edit(folder, change)
    with pytest.raises(ConfigurationError, match=sentence):
        Robot.load(folder)


def test_a_robot_as_plans_see_it_is_the_same_with_held_joints_welded_at_home(tmp_path):
    held = ["l_elbow", "l_shoulder_abad", "r_elbow"]
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump({"extends": "mit_humanoid", "held_joints": held}))
    whole = Robot.load(tmp_path)
    planned = whole.planned
    assert set(whole.joint_names) - set(planned.joint_names) == set(held)
    assert planned.mass == pytest.approx(whole.mass)
    q_j = planned.poses["home"] + np.random.default_rng(0).normal(0, 0.2, planned.n_joints)
    q = planned.standing_configuration()
    q[7:] = q_j
    q_whole = np.concatenate([q[:7], whole.with_held(q_j)])
    np.testing.assert_allclose(planned.contact_positions(q), whole.contact_positions(q_whole), atol=1e-12)
    centres = [pin.centerOfMass(r.model, r.model.createData(), x) for r, x in ((planned, q), (whole, q_whole))]
    np.testing.assert_allclose(*centres, atol=1e-12)
    for name, torque in zip(planned.joint_names, planned.actuators.torque_max, strict=True):
        assert torque == whole.actuators.torque_max[whole.joint_names.index(name)]


def test_a_robot_that_holds_nothing_is_planned_as_it_is():
    robot = Robot.load("mit_humanoid")
    assert robot.planned is robot


def test_an_unknown_robot_is_answered_with_those_that_exist():
    with pytest.raises(ConfigurationError, match=r"did you mean 'mini_cheetah'.*one of .*mini_cheetah"):
        Robot.load("mini_cheeta")


def test_a_folder_without_urdf_is_refused(folder):
    (folder / "robot.urdf").unlink()
    with pytest.raises(ConfigurationError, match=r"urdf: there is no file .*robot\.urdf"):
        Robot.load(folder)


@pytest.mark.parametrize("text", ["<robot", "", "not xml at all"])
def test_a_broken_urdf_is_refused(folder, text):
    (folder / "robot.urdf").write_text(text)
    with pytest.raises(ConfigurationError, match="not a URDF"):
        Robot.load(folder)


def test_broken_yaml_is_refused(folder):
    (folder / "robot.yaml").write_text("name: [")
    with pytest.raises(ConfigurationError, match="not valid YAML"):
        Robot.load(folder)
