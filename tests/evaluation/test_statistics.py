"""Distributions and shares against their definitions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerial_evaluation.statistics import Distribution, Share, pooled

SAMPLES = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=50)


def test_of_nothing_there_is_no_distribution():
    assert Distribution.of([]) is None


@given(SAMPLES)
def test_percentiles_are_in_order_and_the_maximum_is_one_of_the_samples(values):
    found = Distribution.of(values)
    assert min(values) <= found.p50 <= found.p95 <= found.p99 <= found.max
    assert found.max in values


@given(SAMPLES)
def test_the_root_mean_square_is_that_of_a_loop(values):
    expected = math.sqrt(math.fsum(value * value for value in values) / len(values))
    assert Distribution.of(values).rms == pytest.approx(expected, abs=1e-9)


def test_percentiles_lie_between_samples():
    found = Distribution.of(range(101))
    assert (found.p50, found.p95, found.p99) == (50.0, 95.0, 99.0)
    assert Distribution.of([1.0, 2.0]).figures("p50", "max", scale=10.0) == {"p50": 15.0, "max": 20.0}


def test_the_interval_of_a_share_is_wilsons():
    low, high = Share(trials=10, succeeded=8).interval
    z, n, p = 1.959964, 10, 0.8  # the normal distribution's 97.5 %
    middle = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    assert (low, high) == pytest.approx((middle - half, middle + half), abs=1e-6)


def test_of_no_trials_nothing_is_known():
    assert (Share(trials=0, succeeded=0).rate, Share(trials=0, succeeded=0).interval) == (None, (0.0, 1.0))


def test_samples_of_runs_without_the_phase_are_left_out():
    runs = [{"flight": {"tilt": [1.0, 2.0]}}, {}, {"flight": {"tilt": [3.0]}}]
    np.testing.assert_array_equal(pooled(runs, "flight", "tilt"), [1.0, 2.0, 3.0])
    assert len(pooled(runs, "landing", "tilt")) == 0
