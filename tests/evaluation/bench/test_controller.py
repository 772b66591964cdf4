"""The controller's benchmark, end to end on one jump."""

import pytest

from aerial_evaluation.bench.controller import SECTIONS
from aerial_evaluation.bench.planner import measured
from aerial_evaluation.bench.subject import Subject
from aerial_model.robot.robot import Robot
from aerial_wbic.gains import QpSolver, TaskOrder
from aerial_wbic.stopwatch import Part

FORCE_TOLERANCE = 2.0  # between forces of two solvers [N]


@pytest.fixture(scope="module")
def rows():
    subject = Subject(robot=Robot.load("mini_cheetah"), motions=("jump",), repeats=1)
    return list(measured(subject, ("ticks", "solvers"), SECTIONS))  # TSID has an environment of its own


def of(rows, section):
    return [row for row in rows if row["section"] == section]


def test_every_solver_and_every_order_of_tasks_is_timed(rows):
    timed = {(row["tasks"], row["qp_solver"]) for row in of(rows, "ticks")}
    assert timed == {("wbc_c", solver) for solver in QpSolver} | {(order, "osqp") for order in TaskOrder}


def test_the_parts_make_up_the_tick(rows):
    for row in of(rows, "ticks"):
        assert set(row["parts_us"]) == set(Part)
        assert 0 < row["tick_us"]["p50"] <= row["tick_us"]["p99"] <= row["tick_us"]["max"]
        assert sum(part["p50"] for part in row["parts_us"].values()) < 2 * row["tick_us"]["p50"]


def test_solvers_agree_on_the_forces_of_a_jump(rows):
    for row in of(rows, "solvers"):
        assert row["solved"] == row["trials"] == row["problems"]
        assert row["greatest_difference_n"] < FORCE_TOLERANCE
