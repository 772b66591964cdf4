"""Environments of peers, and the problem crocoddyl is given; crocoddyl itself is not needed."""

import json
import os

import numpy as np
import pinocchio as pin
import pytest

from aerial_evaluation.bench.crocoddyl_peer import PEER, crocoddyl, problem
from aerial_evaluation.bench.environment import Environment, PeerError
from aerial_evaluation.bench.subject import Subject, usual_request
from aerial_model.robot.robot import JOINT_POSITION, Robot
from aerial_planner.planner import Planner


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture(scope="module")
def planner(robot):
    return Planner(robot)


@pytest.fixture(scope="module")
def plan(planner, robot):
    return planner.plan(usual_request("jump", robot)).plan


@pytest.fixture
def elsewhere(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path


def made(folder, *, python=None):
    """An environment that says it is made; what it runs is a script of one line."""
    (folder / "bin").mkdir(parents=True)
    (folder / "made-from").write_text("\n".join(PEER.requirements))
    if python is not None:
        (folder / "bin" / "python").write_text(f"#!/bin/sh\n{python}\n")
        os.chmod(folder / "bin" / "python", 0o755)
    return Environment(PEER, folder)


def test_without_crocoddyl_it_says_what_makes_it(robot, elsewhere):
    with pytest.raises(PeerError, match=r"crocoddyl is not in .*--with-peers") as missing:
        crocoddyl(Subject(robot=robot, motions=("jump",)))
    assert str(elsewhere) in str(missing.value)


def test_an_environment_made_from_other_versions_does_not_do(tmp_path):
    environment = made(tmp_path)
    assert environment.is_made
    (tmp_path / "made-from").write_text("crocoddyl==3.0.0")
    assert not environment.is_made


def test_what_the_script_prints_comes_back(tmp_path):
    assert made(tmp_path, python="cat").solve({"dt": 0.01}) == {"dt": 0.01}


def test_a_script_that_fails_is_one_sentence(tmp_path):
    with pytest.raises(PeerError, match="ended with status 3: no such solver"):
        made(tmp_path, python="echo no such solver >&2; exit 3").solve({})


def test_an_environment_without_python_is_one_sentence(tmp_path):
    with pytest.raises(PeerError, match="cannot be run"):
        made(tmp_path).solve({})


def test_an_environment_that_cannot_be_made_is_one_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(PeerError, match="cannot be made"):
        Environment(PEER, tmp_path / "file" / "folder").make()


def test_the_problem_is_the_plans(plan, planner, robot):
    asked = problem(plan, robot, planner.settings, repeats=2)
    assert asked == json.loads(json.dumps(asked))
    contact = np.array(asked["contact"])
    assert contact.shape == (round(plan.take_off_time / asked["dt"]), robot.n_contacts)
    assert contact.all()
    np.testing.assert_allclose(asked["q_landing"], plan.q[-1])
    assert asked["flight_time"] == pytest.approx(plan.landing_time - plan.take_off_time)


def test_the_peer_finds_the_same_robot_in_the_problem(plan, planner, robot):
    asked = problem(plan, robot, planner.settings, repeats=1)
    model = pin.buildModelFromXML(asked["urdf"], pin.JointModelFreeFlyer())
    assert pin.computeTotalMass(model) == pytest.approx(robot.mass)
    assert all(model.existFrame(name) for name in asked["contact_frames"])
    low, high = np.array(asked["joint_min"]), np.array(asked["joint_max"])
    q_j = plan.q[:, JOINT_POSITION]
    assert np.all(q_j[0] > low)
    assert np.all(q_j[0] < high)


@pytest.mark.skipif(not Environment(PEER).is_made, reason="crocoddyl is not installed")
def test_the_peer_solves_the_problem(plan, planner, robot):
    (run,) = Environment(PEER).solve(problem(plan, robot, planner.settings, repeats=1))["runs"]
    assert run["converged"]
    assert run["landing_error_m"] < 0.01
    assert run["peak_torque_ratio"] < 1.0
