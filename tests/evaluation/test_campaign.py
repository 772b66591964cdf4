"""Campaigns: trials are determined by seed and world, shares come with their intervals, a lost worker loses nothing."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_hex

from aerial_evaluation.campaign.campaign import FIGURES, Campaign, Executed, Trial, TrialResult
from aerial_evaluation.campaign.figure import FAILED, LANDED, draw
from aerial_evaluation.campaign.summary import summary
from aerial_evaluation.campaign.variation import Variation, trials
from aerial_evaluation.campaign.workers import results, workers
from aerial_evaluation.judgement.landing import Landing
from aerial_model.errors import ConfigurationError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_sim.conditions import Conditions


def result(seed, landed, **conditions):
    landing = Landing(
        checks={"upright": landed},
        tilt=np.radians(1.0 + seed),
        height=0.3,
        position_error=0.03,
        rotation=np.zeros(3),
        rotation_error=np.radians(2.0),
        apex=0.5,
        peak_torque_ratio=0.8,
        peak_voltage_ratio=0.9,
    )
    executed = Executed(landing=landing, estimate={}, tracking={}, plan_time=0.1, real_time_factor=5.0)
    trial = Trial(seed=seed, conditions=Conditions(**conditions))
    return TrialResult(trial=trial, reason="" if landed else "upright", executed=executed)


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
    figures = summary(done, [Variation(name="friction", low=0.5, high=0.7, steps=2)]).to_json()
    assert (figures["trials"], figures["landed"], figures["success_rate"]) == (20, 18, 0.9)
    assert [(row["friction"], row["landed"]) for row in figures["conditions"]] == [(0.5, 8), (0.7, 10)]
    assert [row["figures"]["tilt_deg"]["max"] for row in figures["conditions"]] == pytest.approx([8.0, 10.0])
    np.testing.assert_allclose(figures["conditions"][0]["interval95"], [0.4902, 0.9433], atol=1e-4)  # Wilson, by hand
    assert figures["failures"] == [
        {"seed": seed, "reason": "upright", "conditions": {"friction": 0.5}} for seed in (8, 9)
    ]
    assert figures["figures"]["tilt_deg"]["max"] == pytest.approx(10.0)


def test_a_campaign_of_refusals_has_a_share_and_no_figures():
    refused = [TrialResult(trial=Trial(seed=0, conditions=Conditions()), reason="refused: too far")]
    figures = summary(refused).to_json()
    assert (figures["trials"], figures["landed"], figures["figures"]) == (1, 0, {})
    assert figures["failures"] == [{"seed": 0, "reason": "refused: too far", "conditions": {}}]


def test_the_figure_shows_every_trial_at_its_share_of_each_limit(tmp_path):
    done = [result(seed, landed=seed < 2) for seed in range(3)]
    (axes,) = draw("three hops", done, [], tmp_path / "one.png").axes
    shown = {}
    for dots in axes.collections:
        for x, y in np.asarray(dots.get_offsets()):
            shown.setdefault((round(y), to_hex(dots.get_facecolor()[0])), []).append(x)
    tilt, position = FIGURES.index("tilt_deg"), FIGURES.index("position_error_m")
    assert shown[tilt, LANDED] == pytest.approx([0.1, 0.2])  # of 10°
    assert shown[tilt, FAILED] == pytest.approx([0.3])
    assert shown[position, LANDED] == pytest.approx([0.2, 0.2])  # of 0.15 m


def test_the_figure_shows_the_share_over_the_condition_that_has_steps(tmp_path):
    done = [result(seed, landed=seed < 2, mass=1.0) for seed in range(4)] + [result(0, landed=True, mass=1.1)]
    steps = summary(done, [Variation(name="mass", low=1.0, high=1.1, steps=2)]).steps
    shares, _ = draw("by mass", done, steps, tmp_path / "two.png").axes
    np.testing.assert_allclose(shares.lines[0].get_xydata(), [[1.0, 50.0], [1.1, 100.0]])
    assert (tmp_path / "two.png").read_bytes().startswith(b"\x89PNG")


def test_a_trial_in_a_worker_is_the_trial_alone():
    robot = Robot.load("mini_cheetah")
    campaign = Campaign(robot=robot, request=MotionRequest(motion="jump", displacement=np.array([0.2, 0.0, 0.0])))
    [trial] = trials(1, 3, [Variation(name="friction", low=0.6, high=0.8)])
    with workers(1) as client:
        [there] = results(campaign, [trial], client)
    here = campaign.attempt(trial)
    assert there.landed
    timings = dict.fromkeys(("plan_time_s", "real_time_factor"))
    assert there.to_json() | timings == here.to_json() | timings


def test_a_refused_goal_is_a_trial_that_did_not_land():
    robot = Robot.load("mini_cheetah")
    campaign = Campaign(robot=robot, request=MotionRequest(motion="jump", displacement=np.array([9.0, 0.0, 0.0])))
    [trial] = trials(1)
    found = campaign.attempt(trial)
    assert not found.landed
    assert found.reason.startswith("refused: ")
    assert found.to_json().keys() == {"seed", "conditions", "landed", "reason"}


def test_a_scheduler_that_is_not_there_is_told(monkeypatch):
    monkeypatch.setattr("aerial_evaluation.campaign.workers.CONNECT_TIMEOUT", 0.5)
    with (
        pytest.raises(ConfigurationError, match="no Dask scheduler answers"),
        workers(1, "tcp://127.0.0.1:9"),
    ):
        pass
