"""Everything that can be wrong with a robot folder is a sentence."""

import shutil

import pytest

from aerial_evaluation.robot_check import ERROR, check
from aerial_model.robot.loading import known_robots


@pytest.fixture
def folder(tmp_path):
    return shutil.copytree(known_robots()["mini_cheetah"], tmp_path / "robot")


def edited(folder, name, *pairs):
    file = folder / name
    text = file.read_text()
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    file.write_text(text)
    return check(str(folder))


@pytest.mark.parametrize("name", sorted(known_robots()))
def test_the_robots_that_come_with_the_project_have_nothing_to_mend(name):
    assert [finding.text for finding in check(name) if finding.level == ERROR] == []


@pytest.mark.parametrize(
    ("name", "pairs", "sentence"),
    [
        ("robot.urdf", [('<mass value="0.634"/>', '<mass value="-1"/>')], "its mass is -1.0 kg"),
        ("robot.urdf", [('ixx="381e-6"', 'ixx="-381e-6"')], "not positive definite"),
        ("robot.urdf", [('ixx="381e-6"', 'ixx="381e-3"')], "triangle inequality"),
        ("robot.urdf", [('<axis xyz="1 0 0"/>', '<axis xyz="2 0 0"/>')], "its axis has length 2"),
        ("robot.urdf", [('lower="-1.5" upper="1.5"', 'lower="1.5" upper="-1.5"')], "is empty"),
        ("robot.urdf", [('effort="18" velocity="40"', 'effort="0" velocity="0"')], "says nothing about its motor"),
        ("robot.urdf", [('type="revolute"', 'type="planar"')], "is planar"),
        (
            "robot.urdf",
            [('<parent link="base"/><child link="fr_abad_link"/>', '<parent link="bas"/><child link="fr_abad_link"/>')],
            "link 'bas', which there is not",
        ),
        (
            "robot.urdf",
            [('<box size="0.38 0.098 0.10"/>', '<mesh filename="meshes/trunk.stl"/>')],
            "mesh file meshes/trunk.stl is not found",
        ),
        ("robot.urdf", [("<robot", "<model"), ("</robot>", "</model>")], "expected <robot>, found <model>"),
        ("robot.urdf", [("</robot>", "")], "not readable as XML"),
        ("robot.yaml", [("knee: 1.6}", "knee: 2.9}")], "outside its stops"),
        ("robot.yaml", [("  home: {abad: 0.0,", "  home: {fr_knee: 1.0, abad: 0.0,")], "off the ground at home"),
        ("robot.yaml", [("back_emf_constant: 0.10", "back_emf_constant: 0.01")], "look at back_emf_constant"),
        ("robot.yaml", [("torque_max: 27.99", "torque_max: 2.799")], "just to stand"),
        ("robot.yaml", [("name: mini_cheetah", "nam: mini_cheetah")], "unknown key 'nam'"),
    ],
)
def test_what_is_wrong_is_named(folder, name, pairs, sentence):
    findings = edited(folder, name, *pairs)
    assert any(sentence in finding.text for finding in findings), [finding.text for finding in findings]


def test_a_urdf_alone_is_checked_too(folder):
    assert check(str(folder / "robot.urdf")) == []


def test_what_is_not_there_is_said():
    (finding,) = check("no_such_robot")
    assert finding.level == ERROR
    assert "no robot 'no_such_robot'" in finding.text
