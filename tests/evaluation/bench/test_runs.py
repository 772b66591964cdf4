"""Fingerprints of runs: equal for equal runs, different for any other number, and compared by name."""

import dataclasses
import json

import numpy as np
import pytest

from aerial_evaluation.bench.runs import Fingerprint, cases, commands_hash, differences, fingerprints, load, plan_hash
from aerial_evaluation.closed_loop import run
from aerial_model.errors import ConfigurationError
from aerial_model.robot.loading import known_robots
from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Plan

PLAN_TEXTS = {
    "motion",
    "robot",
    "model_hash",
    "request_id",
    "terrain",
    "ending",
}  # what a plan is for: no numbers of the motion


@pytest.fixture(scope="module")
def record():
    robot = Robot.load("mini_cheetah")
    return run(robot, cases()[0].request(robot), seed=0)


def test_the_usual_runs_are_of_every_robot_and_have_names_of_their_own():
    usual = cases()
    assert len({case.name for case in usual}) == len(usual) == 30
    assert {case.robot for case in usual} <= set(known_robots())
    for case in usual:
        assert case.request(Robot.load(case.robot)).motion == case.motion


def test_a_case_brings_its_terrain():
    robot = Robot.load("mini_cheetah")
    onto = next(case for case in cases() if case.platform).request(robot)
    assert onto.terrain.height(onto.displacement[:2]) == pytest.approx(onto.displacement[2])
    assert next(case for case in cases() if case.hurdle).request(robot).terrain.boxes[0].top == pytest.approx(0.1)


def test_every_number_of_a_plan_is_in_its_hash(record):
    plan, usual = record.plan, plan_hash(record.plan)
    assert plan_hash(dataclasses.replace(plan)) == usual
    for field in dataclasses.fields(Plan):
        if field.name in PLAN_TEXTS:
            continue
        value = np.array(getattr(plan, field.name))
        value = ~value if value.dtype == bool else np.nextafter(value, np.inf)
        changed = dataclasses.replace(plan, **{field.name: value if value.ndim else float(value)})
        assert plan_hash(changed) != usual, field.name


@pytest.mark.parametrize("name", ["torque", "position", "velocity", "stiffness", "damping"])
def test_every_number_of_the_commands_is_in_their_hash(record, name):
    commands = record.commands
    last = dataclasses.replace(commands[-1], **{name: np.nextafter(getattr(commands[-1], name), np.inf)})
    assert commands_hash([*commands[:-1], last]) != commands_hash(commands)
    assert commands_hash(commands[:-1]) != commands_hash(commands)


def test_what_was_written_is_found_equal_and_what_changed_is_named(record, tmp_path):
    file = tmp_path / "before.json"
    rows = [Fingerprint.of("hop", record).to_json()]
    file.write_text(json.dumps({"rows": rows}))
    before = load(file)
    assert differences(rows, before) == {}
    assert differences([{**rows[0], "commands": "0"}], before) == {"hop": ["commands"]}
    assert differences([{**rows[0], "name": "leap"}], before) == {"leap": ["not made before"]}


def test_a_refusal_is_a_fingerprint_too():
    (refused,) = fingerprints([dataclasses.replace(cases()[0], displacement=np.array([9.0, 0.0, 0.0]))])
    assert (refused.plan, refused.commands, refused.landing) == (None, None, None)
    assert "out of reach" in refused.refusal


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("runs: []", "a list of runs"),
        ("runs: [{robot: mini_cheetah, motoin: jump}]", "unknown key 'motoin' .did you mean 'motion'"),
        ("- 1", "expected a mapping"),
    ],
)
def test_a_list_that_makes_no_sense_is_one_sentence(tmp_path, text, sentence):
    (tmp_path / "runs.yaml").write_text(text)
    with pytest.raises(ConfigurationError, match=sentence):
        cases(tmp_path / "runs.yaml")


@pytest.mark.parametrize("text", ["{", "[]", '{"rows": [1]}', '{"rows": [{}]}'])
def test_a_file_that_is_no_list_of_fingerprints_is_one_sentence(tmp_path, text):
    (tmp_path / "before.json").write_text(text)
    with pytest.raises(ConfigurationError, match=r"what \./aerial bench runs wrote"):
        load(tmp_path / "before.json")
