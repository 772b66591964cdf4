"""A folder of plans as the start of new ones; whatever is in that folder, planning goes on."""

import dataclasses

import numpy as np
import pytest

from aerial_model.errors import ConfigurationError
from aerial_model.values.plan_file import load_plan, save_plan
from aerial_model.values.request import MotionRequest
from aerial_planner.assembly.library import PlanLibrary

from ..conftest import jump

POSITION_TOLERANCE = 1e-3  # [m] between optima found from different starts


@pytest.fixture
def warnings():
    return []


@pytest.fixture
def library(tmp_path, robot, warnings):
    return PlanLibrary(tmp_path / "plans", robot, warnings.append)


@pytest.fixture
def with_library(planner, library):
    planner.plans = library
    yield planner
    planner.plans = None


def test_a_near_plan_replaces_the_single_rigid_body_and_saves_iterations(with_library, library, forward):
    goal = jump(0.45, 0.05)
    usual = with_library.plan(goal)  # there is nothing near yet
    library.add(forward.plan)
    near = with_library.plan(jump(0.44, 0.02))
    assert usual.report.started_from == "srbm"
    assert near.report.started_from == "library"
    assert near.report.srbm_time_s == 0.0
    assert near.report.iterations <= usual.report.iterations / 2


def test_a_plan_from_a_near_one_is_the_one_from_the_single_rigid_body(with_library, library, planner, forward):
    library.add(forward.plan)
    near = with_library.plan(jump(0.5, 0.1))
    planner.plans = None
    usual = planner.plan(jump(0.5, 0.1))
    assert near.report.started_from == "library"
    np.testing.assert_allclose(near.plan.com, usual.plan.com, atol=POSITION_TOLERANCE)


def test_a_plan_for_a_fast_roll_starts_the_next_one(with_library):
    with_library.plan(MotionRequest(motion="barrel_roll"))
    again = with_library.plan(MotionRequest(motion="barrel_roll", displacement=np.array([0.05, -0.25, 0.0])))
    assert again.report.started_from == "library"


@pytest.mark.parametrize(
    "goal",
    [jump(1.0, 0.0), jump(0.4, 0.0, yaw=2.5), MotionRequest(motion="front_flip"), jump(0.4, 0.0, warm_start=False)],
    ids=["far", "turned", "other contacts", "no warm start wanted"],
)
def test_what_is_not_near_or_not_wanted_starts_nothing(with_library, library, forward, goal):
    library.add(forward.plan)
    assert with_library.plan(goal).report.started_from in ("srbm", "reference")


def test_plans_are_found_again_by_the_next_process(library, robot, forward, warnings):
    library.add(forward.plan)
    again = PlanLibrary(library.folder, robot, warnings.append)
    assert (len(again), warnings) == (1, [])
    assert load_plan(next(library.folder.iterdir()), robot).motion == "jump"


def test_nearly_the_same_plan_is_kept_once(with_library, library):
    for x in (0.3, 0.301, 0.302):
        with_library.plan(jump(x, 0.0))
    assert len(library) == len(list(library.folder.iterdir())) == 1


def test_what_is_no_plan_of_this_robot_is_skipped_with_a_sentence(library, robot, forward, warnings):
    library.add(forward.plan)
    save_plan(dataclasses.replace(forward.plan, model_hash="other"), library.folder / "foreign.npz")
    save_plan(dataclasses.replace(forward.plan, take_off_time=0.123), library.folder / "odd.npz")
    np.savez(library.folder / "old.npz", format=0)
    (library.folder / "torn.npz").write_bytes(next(library.folder.glob("jump*")).read_bytes()[:999])
    (library.folder / "junk.npz").write_text("junk")
    (library.folder / "empty.npz").touch()
    (library.folder / "notes.txt").write_text("no plan, and not called one")
    (library.folder / "folder.npz").mkdir()
    again = PlanLibrary(library.folder, robot, warnings.append)
    assert len(again) == 1
    skipped = sorted(warning.split()[2] for warning in warnings)
    names = ("empty", "folder", "foreign", "junk", "odd", "old", "torn")
    assert skipped == [f"{name}.npz" for name in names]


def test_a_file_is_no_library(robot, tmp_path, warnings):
    (tmp_path / "plans").write_text("a file where the folder should be")
    with pytest.raises(ConfigurationError, match="plans: cannot be read"):
        PlanLibrary(tmp_path / "plans", robot, warnings.append)


def test_a_disk_that_takes_no_plan_is_told_and_the_plan_is_made(with_library, library, warnings):
    library.folder.parent.joinpath("plans").write_text("a file where the folder should be")
    assert with_library.plan(jump(0.4, 0.0)).report.success
    assert len(warnings) == 1
    assert "kept in memory only" in warnings[0]


def test_a_stored_plan_that_misleads_costs_time_and_not_the_plan(with_library, library, forward):
    wild = np.random.default_rng(0).normal(scale=1e5, size=forward.plan.force.shape)
    library.add(dataclasses.replace(forward.plan, force=wild, com=np.zeros_like(forward.plan.com)))
    report = with_library.plan(jump(0.4, 0.0)).report
    assert (report.success, report.started_from) == (True, "srbm")
