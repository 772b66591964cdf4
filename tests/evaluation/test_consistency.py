"""Errors of an estimate are measured as they are, and normalized by what the estimator claims."""

import numpy as np
import pytest

from aerial_evaluation.judgement.consistency import SAMPLES, Belief, sampled, summary
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_LINEAR, BASE_ORIENTATION, BASE_POSITION, Robot
from aerial_model.values.estimate import Estimate
from aerial_wbic.behaviours.phase import Phase

ORIGIN = np.array([1.0, -2.0, 0.16])
ROBOT = Robot.load("mini_cheetah")


@pytest.fixture
def truth():
    q, v = ROBOT.standing_configuration(), np.zeros(ROBOT.model.nv)
    q[BASE_POSITION] += ORIGIN
    q[BASE_ORIENTATION] = rotation.exp(np.array([0.1, 1.0, -2.0]))
    v[BASE_LINEAR] = [1.0, 2.0, 3.0]
    return q, v


def estimate(q, v, **variances):
    q = q.copy()
    q[BASE_POSITION] -= ORIGIN
    return Estimate(time=0.0, q=q, v=v.copy(), **{"position_variance": 1e-4, "velocity_variance": 1e-2, **variances})


def belief(believed, truth, phase=Phase.STAND):
    return Belief(phase=phase, estimate=believed, q=truth[0], v=truth[1])


def test_a_perfect_estimate_has_no_error(truth):
    figures = belief(estimate(*truth), truth).figures(ORIGIN)
    np.testing.assert_allclose(list(figures.values()), 0.0, atol=1e-9)


def test_errors_as_large_as_claimed_on_every_axis_have_a_normalized_square_of_one(truth):
    believed = estimate(*truth)
    believed.q[BASE_POSITION] += 0.01
    believed.v[BASE_LINEAR] += 0.1
    figures = belief(believed, truth).figures(ORIGIN)
    assert (figures["position_nees"], figures["velocity_nees"]) == pytest.approx((1.0, 1.0))
    assert figures["position_m"] == pytest.approx(0.01 * np.sqrt(3))


def test_a_wrong_attitude_turns_the_velocity(truth):
    believed = estimate(*truth)
    believed.q[BASE_ORIENTATION] = rotation.multiply(truth[0][BASE_ORIENTATION], rotation.exp(np.array([0.01, 0, 0])))
    figures = belief(believed, truth).figures(ORIGIN)
    assert figures["attitude_deg"] == pytest.approx(np.rad2deg(0.01))
    assert figures["velocity_m_s"] == pytest.approx(0.01 * np.hypot(2.0, 3.0), rel=0.01)


def test_standing_before_a_flight_is_stance_and_after_it_landing(truth):
    phases = [Phase.STAND] * 100 + [Phase.TAKE_OFF] * 10 + [Phase.FLIGHT] * 40 + [Phase.LANDING] * 5 + [Phase.STAND] * 5
    samples = sampled([belief(estimate(*truth), truth, phase) for phase in phases], ORIGIN)
    assert {name: len(figures["position_m"]) for name, figures in samples.items()} == {
        "stance": SAMPLES,
        "take_off": 10,
        "flight": SAMPLES,
        "landing": 10,
    }


def test_many_runs_have_their_errors_pooled_and_an_interval_for_the_normalized_ones():
    same = {name: [1.0, 1.0] for name in ("velocity_m_s", "attitude_deg", "position_nees", "velocity_nees")}
    runs = [{"stance": {**same, "position_m": [k, k]}} for k in (3.0, 4.0)]
    figures = summary(runs)
    assert list(figures) == ["stance"]
    assert figures["stance"]["position_m"]["rms"] == pytest.approx(np.sqrt(12.5))
    assert figures["stance"]["position_nees"] == 1.0
    np.testing.assert_allclose(figures["stance"]["nees_interval95"], np.array([1.237, 14.449]) / 6, atol=1e-3)
