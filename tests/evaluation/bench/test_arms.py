"""What arms do in a spin of the humanoid, and in one of a robot that has none."""

import numpy as np
from PIL import Image

from aerial_evaluation.bench.arms import PARTS
from aerial_evaluation.bench.controller import SECTIONS
from aerial_evaluation.bench.planner import measured
from aerial_evaluation.bench.subject import Subject
from aerial_model.robot.robot import Robot


def rows_of(robot, folder):
    subject = Subject(robot=Robot.load(robot), motions=("spin",), folder=folder)
    return list(measured(subject, ("arms",), SECTIONS))


def test_arms_swing_as_planned_and_carry_a_part_of_the_angular_momentum(tmp_path):
    take_off, flight, landing = rows = rows_of("mit_humanoid", tmp_path)
    assert [row["phase"] for row in rows] == ["take-off", "flight", "landing"]
    assert all(row["landed"] for row in rows)
    for row in rows:
        assert 0.0 < row["share"] < 0.2  # two arms of 2.8 kg
        assert row["momentum"]["arms"] < row["momentum"]["base"]
    for row in (take_off, flight):
        assert row["travel_deg"] > 3.0
        assert row["off_plan_deg"] < 5.0
    assert landing["off_plan_deg"] is None  # the plan ends with touchdown
    image = np.asarray(Image.open(tmp_path / "arms_spin.png").convert("RGB")).reshape(-1, 3).astype(int)
    for colour in PARTS.values():  # of the lines of base, legs and arms
        assert np.sum(np.all(np.abs(image - [int(colour[k : k + 2], 16) for k in (1, 3, 5)]) < 8, axis=1)) > 100


def test_a_robot_without_arms_has_no_rows(tmp_path):
    assert rows_of("mini_cheetah", tmp_path) == []
