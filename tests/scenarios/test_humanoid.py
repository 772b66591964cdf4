"""The humanoid jumps and spins in closed loop, with noisy sensors: the same code as the quadruped, by data alone."""

import numpy as np
import pytest

from aerial_evaluation.closed_loop import run
from aerial_evaluation.judgement.landing import judge
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.planner import Planner

GOALS = {
    "forward": MotionRequest(motion="jump", displacement=np.array([0.52, 0.0, 0.0])),
    "spin": MotionRequest(motion="spin"),
}


@pytest.fixture(scope="module")
def planner():
    return Planner(Robot.load("mit_humanoid"))


@pytest.mark.parametrize("name", GOALS)
def test_it_lands(planner, name):
    assert judge(run(planner.robot, GOALS[name], seed=2, planner=planner)).failed == ()


def test_its_heels_leave_before_its_toes_and_its_arms_move_unasked(planner):
    plan = planner.plan(GOALS["forward"]).plan
    names = [point.name for point in planner.robot.contact_points]
    ends = {name: plan.time[np.flatnonzero(plan.contact[:, i])[-1]] for i, name in enumerate(names)}
    assert max(ends["r_heel"], ends["l_heel"]) < min(ends["r_toe"], ends["l_toe"])
    arms = plan.q[:, 7:][:, planner.robot.arms]
    assert np.ptp(arms, axis=0).max() > 0.3  # [rad]
    assert not np.any(plan.time[plan.contact.any(axis=1)] > plan.take_off_time)
