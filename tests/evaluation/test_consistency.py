"""Errors of an estimate are measured as they are, and normalized by what the estimator claims."""

import dataclasses

import numpy as np
import pytest

from aerial_evaluation.judgement.consistency import SAMPLES, errors, sampled, summary
from aerial_evaluation.record import IncompleteRunError, Run, Tick
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_LINEAR, BASE_ORIENTATION, BASE_POSITION, Robot
from aerial_model.values.estimate import Estimate
from aerial_model.values.frame import StartFrame
from aerial_sim.simulation import Simulation
from aerial_wbic.behaviours.phase import Phase

ORIGIN = np.array([1.0, -2.0, 0.16])
ROBOT = Robot.load("mini_cheetah")
STANDING = Simulation(ROBOT, noise="off").ground_truth()


@pytest.fixture
def truth():
    q, v = ROBOT.standing_configuration(), np.zeros(ROBOT.model.nv)
    q[BASE_POSITION] += ORIGIN
    q[BASE_ORIENTATION] = rotation.exp(np.array([0.1, 1.0, -2.0]))
    v[BASE_LINEAR] = [1.0, 2.0, 3.0]
    return dataclasses.replace(STANDING, q=q, v=v)


def estimate(truth, origin=ORIGIN):
    q = truth.q.copy()
    q[BASE_POSITION] -= origin
    return Estimate(time=0.0, q=q, v=truth.v.copy(), position_variance=1e-4, velocity_variance=1e-2)


def test_a_perfect_estimate_has_no_error(truth):
    np.testing.assert_allclose(list(errors(estimate(truth), truth, ORIGIN).values()), 0.0, atol=1e-9)


def test_errors_as_large_as_claimed_on_every_axis_have_a_normalized_square_of_one(truth):
    wrong = estimate(truth)
    wrong.q[BASE_POSITION] += 0.01
    wrong.v[BASE_LINEAR] += 0.1
    figures = errors(wrong, truth, ORIGIN)
    assert (figures["position_nees"], figures["velocity_nees"]) == pytest.approx((1.0, 1.0))
    assert figures["position_m"] == pytest.approx(0.01 * np.sqrt(3))


def test_a_wrong_attitude_turns_the_velocity(truth):
    wrong = estimate(truth)
    wrong.q[BASE_ORIENTATION] = rotation.multiply(truth.q[BASE_ORIENTATION], rotation.exp(np.array([0.01, 0, 0])))
    figures = errors(wrong, truth, ORIGIN)
    assert figures["attitude_deg"] == pytest.approx(np.rad2deg(0.01))
    assert figures["velocity_m_s"] == pytest.approx(0.01 * np.hypot(2.0, 3.0), rel=0.01)


def record(phases):
    """A run that drifts by 1 mm a tick while the estimator knows it: each estimate is of the state before its tick."""
    ticks, truth = [], STANDING
    origin = StartFrame.of(ROBOT, STANDING.q).origin
    for phase in phases:
        q = truth.q.copy()
        q[0] += 0.001
        moved = dataclasses.replace(truth, q=q)
        ticks.append(Tick(truth=moved, phase=phase, estimate=estimate(truth, origin)))
        truth = moved
    return Run(robot=ROBOT, plan=None, start_frame=StartFrame(), start_time=0.0, ticks=ticks, initial=STANDING)


def test_standing_before_a_flight_is_stance_and_after_it_landing():
    phases = [Phase.STAND] * 100 + [Phase.TAKE_OFF] * 10 + [Phase.FLIGHT] * 40 + [Phase.LANDING] * 5 + [Phase.STAND] * 5
    assert {name: len(figures["position_m"]) for name, figures in sampled(record(phases)).items()} == {
        "stance": SAMPLES,
        "take_off": 10,
        "flight": SAMPLES,
        "landing": 10,
    }


def test_an_estimate_is_compared_with_the_state_that_was_measured():
    figures = sampled(record([Phase.STAND] * 10))["stance"]
    np.testing.assert_allclose(figures["position_m"], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("lost", "sentence"),
    [
        ({"ticks": [Tick(truth=STANDING)]}, "no estimate of the state at 0.000 s"),
        ({"initial": None}, "does not say where"),
    ],
)
def test_a_run_without_estimates_says_so(lost, sentence):
    with pytest.raises(IncompleteRunError, match=sentence):
        sampled(dataclasses.replace(record([Phase.STAND]), **lost))


def test_many_runs_have_their_errors_pooled_and_an_interval_for_the_normalized_ones():
    same = {name: [1.0, 1.0] for name in ("velocity_m_s", "attitude_deg", "position_nees", "velocity_nees")}
    runs = [{"stance": {**same, "position_m": [k, k]}} for k in (3.0, 4.0)]
    figures = summary(runs)
    assert list(figures) == ["stance"]
    assert figures["stance"].errors["position_m"].rms == pytest.approx(np.sqrt(12.5))
    assert figures["stance"].normalized["position_nees"] == 1.0
    np.testing.assert_allclose(figures["stance"].interval, np.array([1.237, 14.449]) / 6, atol=1e-3)  # χ² of 6, table
