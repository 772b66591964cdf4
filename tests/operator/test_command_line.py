"""The contract of the command line."""

import json
import shutil

import numpy as np
import pytest
import yaml

from aerial_model.robot.loading import known_robots
from aerial_model.robot.robot import Robot
from aerial_model.values.plan_file import load_plan
from aerial_operator.__main__ import BY_SHELL, COMMANDS

PLAN_KEYS = {
    *("motion", "robot", "variant", "warm_start", "solver", "success", "total_time_s", "solve_time_s", "srbm_time_s"),
    *("started_from", "iterations", "max_violation", "peak_torque_ratio", "peak_voltage_ratio", "peak_speed_ratio"),
    *("take_off_time_s", "flight_time_s", "rotation_deg", "landing_position_m", "refusal"),
}
SIMULATION_KEYS = {
    *("landed", "checks", "tilt_deg", "height_m", "position_error_m", "rotation_deg", "rotation_error_deg", "apex_m"),
    *("peak_torque_ratio", "peak_voltage_ratio", "tick_us", "real_time_factor", "plan", "seed"),
}

OUT_OF_REACH = ("out_of_reach", "no_solution")  # found by the first stage, or only by the second


@pytest.fixture(scope="module")
def planned(aerial_process, tmp_path_factory):
    file = tmp_path_factory.mktemp("plan") / "forward"
    return aerial_process("plan", "jump", "--to", "0.3,0,0", "--json", "--out", file), file


@pytest.fixture(scope="module")
def simulated(aerial_process):
    return aerial_process("simulate", "jump", "--to", "-0.2,0,0", "--seed", 3, "--json")


def test_plan_prints_one_object_with_all_figures(planned):
    ended, _ = planned
    assert ended.status == 0
    assert ended.figures.keys() >= PLAN_KEYS
    assert ended.figures["success"]
    assert ended.figures["refusal"] is None
    np.testing.assert_allclose(ended.figures["landing_position_m"], [0.3, 0.0, 0.0], atol=0.01)


def test_plan_saves_the_plan_it_reports(planned):
    ended, file = planned
    plan = load_plan(file, Robot.load("mini_cheetah"))
    assert plan.take_off_time == ended.figures["take_off_time_s"]


def test_a_saved_plan_starts_the_next_one(aerial, planned, tmp_path):
    shutil.copy(planned[1], tmp_path / "forward.npz")
    ended = aerial("plan", "jump", "--to", "0.35,0,0", "--library", tmp_path)
    assert "library start" in ended.output
    assert len(list(tmp_path.iterdir())) == 2


def test_plan_tells_a_person_the_same(aerial):
    ended = aerial("plan", "jump", "--to", "0.3,0,0")
    assert ended.status == 0
    assert "landing at" in ended.output
    assert "peak voltage" in ended.output


def test_plan_can_be_verified_by_mujoco(aerial, missing_keys):
    ended = aerial("plan", "jump", "--to", "0.3,0,0", "--verify", "--json")
    assert ended.status == 0
    assert ended.figures["verification"]["passed"]
    assert missing_keys("plan", ended.figures) == []


def test_simulate_prints_one_object_with_all_figures(simulated):
    assert simulated.status == 0
    assert simulated.figures.keys() >= SIMULATION_KEYS
    assert simulated.figures["plan"].keys() >= PLAN_KEYS
    assert simulated.figures["tick_us"].keys() == {"p50", "p99", "max"}
    assert simulated.figures["seed"] == 3


def test_simulate_keeps_every_key(simulated, missing_keys):
    assert missing_keys("simulate", simulated.figures) == []


def test_simulate_succeeds_when_the_robot_landed(simulated):
    assert simulated.figures["landed"]
    assert all(simulated.figures["checks"].values())


def test_simulate_tells_a_person_and_draws_a_picture(aerial, tmp_path):
    ended = aerial("simulate", "jump", "--to", "0.2,0", "--noise", "off", "--picture", tmp_path / "jump.png")
    assert ended.status == 0
    assert "landed" in ended.output
    assert (tmp_path / "jump.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["jmup"], "unknown_motion", "did you mean 'jump'"),
        (["jump", "--variant", "XYZ"], "invalid_request", "unknown variant 'XYZ'"),
        (["jump", "--to", "0.6,0,0", "--platform", "0.16"], "invalid_request", "the ground there is 0.16 m high"),
    ],
)
def test_a_refused_plan_has_a_code_and_one_sentence(aerial, arguments, code, words):
    ended = aerial("plan", *arguments, "--json")
    assert ended.status == 1
    assert ended.figures.keys() >= PLAN_KEYS
    assert not ended.figures["success"]
    assert ended.figures["refusal"]["code"] == code
    assert words in ended.figures["refusal"]["reason"]
    assert ended.errors.count("\n") == 1
    assert words in ended.errors


def test_a_goal_3_m_away_is_refused_with_what_binds(aerial):
    ended = aerial("plan", "jump", "--to", "3,0,0", "--json")
    assert ended.status == 1
    assert ended.figures["refusal"]["code"] in OUT_OF_REACH
    assert "what binds" in ended.errors


def test_a_refused_simulation_has_not_landed(aerial, missing_keys):
    ended = aerial("simulate", "jump", "--to", "3,0,0", "--json")
    assert ended.status == 1
    assert missing_keys("refused", ended.figures) == []
    assert not ended.figures["landed"]
    assert ended.figures["refusal"]["code"] in OUT_OF_REACH


def test_a_robot_folder_without_a_key_is_one_sentence(aerial, tmp_path):
    folder = shutil.copytree(known_robots()["mini_cheetah"], tmp_path / "robot")
    data = yaml.safe_load((folder / "robot.yaml").read_text())
    del data["bus_voltage"]
    (folder / "robot.yaml").write_text(yaml.safe_dump(data))
    ended = aerial("plan", "jump", "--robot", folder, "--json")
    assert ended.status == 1
    assert "key 'bus_voltage' is missing" in ended.figures["refusal"]["reason"]
    assert ended.errors.count("\n") == 1


def test_a_misspelt_setting_is_one_sentence(aerial):
    ended = aerial("simulate", "jump", "--set", "controller.weight_bse=1")
    assert ended.status == 1
    assert ended.output.strip() == ""
    assert "unknown key 'weight_bse' (did you mean 'weight_base'?)" in ended.errors
    assert "Traceback" not in ended.errors


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "which command?"),
        (["pln"], "no command 'pln' (did you mean 'plan'?)"),
        (["plan"], "MOTION"),
        (["plan", "jump", "--to", "here"], "such as 0.3,0,0"),
        (["plan", "jump", "--seed", "x"], "--seed"),
        (["plan", "jump", "--edge", "1"], "none is asked for"),
        (["simulate", "jump", "--noise", "loud"], "'nominal', 'off'"),
    ],
)
def test_a_usage_error_ends_with_status_2(aerial, arguments, words):
    ended = aerial(*arguments)
    assert ended.status == 2
    assert ended.output == ""
    assert words in ended.errors


def test_a_usage_error_keeps_to_the_contract_of_json(aerial):
    ended = aerial("plan", "jump", "--to", "here", "--json")
    assert ended.status == 2
    assert ended.figures["refusal"]["code"] == "usage"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(aerial, command):
    ended = aerial(command, "--help")
    assert ended.status == 0
    for option in ("--robot", "--seed", "--json"):
        assert option in ended.output


def test_the_overview_names_every_command(aerial):
    ended = aerial("--help")
    assert ended.status == 0
    for command in (*COMMANDS, *BY_SHELL):
        assert f"  {command} " in ended.output


def test_select_says_when_nobody_is_there(aerial):
    ended = aerial("select", "jump", "--json")
    assert ended.status == 1
    assert ended.figures["refusal"]["code"] == "timeout"
    assert "./aerial up" in json.dumps(ended.figures)


def test_a_urdf_becomes_a_robot_that_is_checked(aerial, tmp_path):
    urdf, folder = known_robots()["mini_cheetah"] / "robot.urdf", tmp_path / "mine"
    drafted = aerial("draft", urdf, "--out", folder, "--json")
    assert drafted.status == 0
    assert drafted.figures["guesses"]
    checked = aerial("check", folder, "--json")
    assert checked.status == 0
    assert not any(finding["level"] == "error" for finding in checked.figures["findings"])
    again = aerial("draft", urdf, "--out", folder)
    assert again.status == 1
    assert "a draft does not overwrite" in again.errors


def test_a_check_that_finds_something_to_mend_fails(aerial, tmp_path):
    urdf = tmp_path / "bad.urdf"
    urdf.write_text((known_robots()["mini_cheetah"] / "robot.urdf").read_text().replace('value="3.3"', 'value="-3.3"'))
    ended = aerial("check", urdf)
    assert ended.status == 1
    assert "link 'base': its mass is -3.3 kg" in ended.output
