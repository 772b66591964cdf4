"""Campaigns: trials are determined by seed and world, shares come with their intervals, a lost worker loses nothing."""

from __future__ import annotations

import numpy as np
import pytest

from aerial_evaluation.campaign.campaign import Campaign, Trial, Variation, results, summary, trials, workers
from aerial_evaluation.campaign.figure import draw
from aerial_model.errors import ConfigurationError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_sim.conditions import Conditions


def result(seed, landed, **conditions):
    trial = Trial(seed=seed, conditions=Conditions(**conditions))
    figures = {"tilt_deg": 1.0 + seed, "position_error_m": 0.01, "rotation_error_deg": 2.0}
    figures |= {"peak_torque_ratio": 0.8, "peak_voltage_ratio": 0.9}
    reason = "" if landed else "upright"
    return {"seed": seed, "conditions": vars(trial.conditions), "landed": landed, "reason": reason, **figures}


def test_steps_are_tried_with_the_same_seeds():
    todo = trials(3, 7, [Variation(name="friction", low=0.4, high=0.8, steps=3)])
    assert [(trial.conditions.friction, trial.seed) for trial in todo] == [
        (pytest.approx(friction), seed) for friction in (0.4, 0.6, 0.8) for seed in (7, 8, 9)
    ]


def test_a_drawn_condition_belongs_to_its_seed():
    variation = Variation(name="mass", low=0.9, high=1.1)
    many = [trial.conditions.mass for trial in trials(50, 0, [variation])]
    assert [trial.conditions.mass for trial in trials(20, 30, [variation])] == many[30:]
    assert 0.9 <= min(many) < 0.93
    assert 1.07 < max(many) <= 1.1


def test_the_world_asked_for_holds_in_all_trials():
    todo = trials(2, 0, [Variation(name="mass", low=0.9, high=1.1)], Conditions(battery=0.8))
    assert {trial.conditions.battery for trial in todo} == {0.8}


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: Variation(name="frictoin", low=0.1, high=0.2), "did you mean 'friction'"),
        (lambda: Variation(name="friction", low=0.3, high=0.2), "LO not above HI"),
        (lambda: Variation(name="friction", low=0.1, high=0.2, steps=1), "at least 2 steps"),
        (lambda: trials(0), "at least 1 trial"),
        (lambda: trials(1, 0, [Variation(name="friction", low=-1.0, high=-0.5)]), "friction must be positive"),
        (
            lambda: trials(1, 0, [Variation(name=name, low=0.5, high=1.0, steps=2) for name in ("mass", "battery")]),
            "only one condition can go in steps, found mass and battery",
        ),
    ],
)
def test_what_makes_no_sense_is_refused(make, reason):
    with pytest.raises(ConfigurationError, match=reason):
        make()


def test_shares_and_intervals_by_condition():
    done = [result(seed, landed=seed < 8, friction=0.5) for seed in range(10)]
    done += [result(seed, landed=True, friction=0.7) for seed in range(10)]
    figures = summary(done, [Variation(name="friction", low=0.5, high=0.7, steps=2)])
    assert (figures["trials"], figures["landed"], figures["success_rate"]) == (20, 18, 0.9)
    assert [(row["friction"], row["landed"]) for row in figures["conditions"]] == [(0.5, 8), (0.7, 10)]
    assert [row["figures"]["tilt_deg"]["max"] for row in figures["conditions"]] == [8.0, 10.0]
    np.testing.assert_allclose(figures["conditions"][0]["interval95"], [0.4902, 0.9433], atol=1e-4)  # Wilson, by hand
    assert figures["failures"] == [
        {"seed": seed, "reason": "upright", "conditions": {"friction": 0.5}} for seed in (8, 9)
    ]
    assert figures["figures"]["tilt_deg"]["max"] == 10.0


def test_the_figure_shows_what_there_is(tmp_path):
    done = [result(seed, landed=seed < 2) for seed in range(3)]
    groups = summary(done, [Variation(name="mass", low=1.0, high=1.1, steps=2)])["conditions"][:1]
    for name, shown in (("one", []), ("two", groups)):
        draw("three hops", done, shown, tmp_path / f"{name}.png")
    assert (tmp_path / "two.png").stat().st_size > (tmp_path / "one.png").stat().st_size > 10_000


def test_a_trial_in_a_worker_is_the_trial_alone():
    robot = Robot.load("mini_cheetah")
    campaign = Campaign(robot=robot, request=MotionRequest(motion="jump", displacement=np.array([0.2, 0.0, 0.0])))
    [trial] = trials(1, 3, [Variation(name="friction", low=0.6, high=0.8)])
    with workers(1) as client:
        [there] = results(campaign, [trial], client)
    here = campaign.attempt(trial)
    assert there["landed"]
    timings = ("plan_time_s", "real_time_factor")
    assert {k: v for k, v in there.items() if k not in timings} == {k: v for k, v in here.items() if k not in timings}


def test_a_refused_goal_is_a_trial_that_did_not_land():
    robot = Robot.load("mini_cheetah")
    campaign = Campaign(robot=robot, request=MotionRequest(motion="jump", displacement=np.array([9.0, 0.0, 0.0])))
    [trial] = trials(1)
    found = campaign.attempt(trial)
    assert not found["landed"]
    assert found["reason"].startswith("refused: ")


def test_a_scheduler_that_is_not_there_is_told(monkeypatch):
    monkeypatch.setattr("aerial_evaluation.campaign.campaign.CONNECT_TIMEOUT", 0.5)
    with (
        pytest.raises(ConfigurationError, match="no Dask scheduler answers"),
        workers(1, "tcp://127.0.0.1:9"),
    ):
        pass
