"""The sections that compare starts and durations, at a few goals near each other."""

import numpy as np
import pytest

from aerial_evaluation.bench import memory, stored, timing
from aerial_evaluation.bench.goals import families
from aerial_evaluation.bench.subject import Subject
from aerial_model.robot.robot import Robot

REACH = np.array([[-0.3, -0.3], [0.5, 0.3]])  # [m] of the goals below


@pytest.fixture(scope="module")
def subject():
    return Subject(robot=Robot.load("mini_cheetah"), motions=("jump",), goals=3)


@pytest.fixture(autouse=True)
def one_family(monkeypatch):
    for section in (stored, timing):
        monkeypatch.setattr(section, "find_reach", lambda family, planner: REACH)
        monkeypatch.setattr(section, "families", lambda robot, motion: families(robot, motion)[:1])


def test_the_library_starts_every_goal_and_takes_fewer_iterations(subject):
    rows = {row["start"]: row for row in stored.library(subject)}
    assert rows["library"]["found"] == rows["library"]["solved"] == 3
    assert rows["srbm"]["found"] == rows["reference"]["found"] == 0
    assert rows["library"]["iterations"]["p95"] < rows["srbm"]["iterations"]["p50"] / 2
    assert subject.planner.plans is None


def test_optimized_durations_cost_less(subject):
    fixed, optimized = timing.timing(subject)
    assert fixed["compared"] == optimized["compared"] == 3
    assert optimized["cost"]["p50"] < fixed["cost"]["p50"]
    assert fixed["take_off_time_s"]["p50"] == pytest.approx(0.4)


def test_memory_is_told_of_varied_requests(subject, monkeypatch):
    monkeypatch.setattr(memory, "REQUESTS", 10)
    rows = memory.memory(subject)
    assert [row["requests"] for row in rows] == list(range(11))
    assert 0 < rows[-1]["planned"] < 10
    assert all(row["memory_mb"] > 50 for row in rows)
