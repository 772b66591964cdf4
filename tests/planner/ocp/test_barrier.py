"""The barrier's derivatives against finite differences, and what its steps promise."""

import numpy as np
import pytest

from aerial_planner.ocp import barrier
from aerial_planner.ocp.barrier import Bounds

LOW = np.array([-1.0, 0.0, -np.inf, 2.0, -np.inf])
HIGH = np.array([1.0, np.inf, 3.0, 2.5, np.inf])
MU = 0.3


@pytest.fixture
def bounds():
    return Bounds.of(LOW, HIGH)


@pytest.fixture
def s(bounds):
    return bounds.interior(np.random.default_rng(0).normal(size=5), 0.1)


def multipliers(bounds, s, mu=MU):
    """Return the multipliers of the central path."""
    return np.where(bounds.has_low, mu / (s - bounds.low), 0.0), np.where(bounds.has_high, mu / (bounds.high - s), 0.0)


def test_logarithms_are_those_of_all_distances(bounds, s):
    distances = np.concatenate([(s - LOW)[np.isfinite(LOW)], (HIGH - s)[np.isfinite(HIGH)]])
    assert barrier.logarithms(bounds, s) == pytest.approx(np.log(distances).sum(), rel=1e-14)


def test_logarithms_of_a_thousand_small_distances_do_not_underflow():
    many = Bounds.of(np.zeros(1000), np.full(1000, np.inf))
    assert barrier.logarithms(many, np.full(1000, 1e-9)) == pytest.approx(1000 * np.log(1e-9), rel=1e-12)


@pytest.mark.parametrize("outside", [-1.0, 1.0])
def test_a_slack_on_its_bound_has_no_logarithm(bounds, s, outside):
    s[0] = outside
    assert np.isnan(barrier.logarithms(bounds, s))


def test_gradient_and_curvature_on_the_central_path_are_those_of_the_barrier(bounds, s):
    weight, slope = np.empty(5), np.empty(5)
    barrier.derivatives(bounds, s, *multipliers(bounds, s), MU, weight, slope)
    h = 1e-5 * np.eye(5)
    phi = [[-MU * barrier.logarithms(bounds, s + sign * step) for sign in (-1, 0, 1)] for step in h]
    np.testing.assert_allclose(slope, [(b - a) / 2e-5 for a, _, b in phi], atol=1e-6)
    np.testing.assert_allclose(weight, [(a - 2 * m + b) / 1e-10 for a, m, b in phi], rtol=1e-3, atol=1e-4)


def test_slacks_are_moved_inside_by_a_share_of_the_range(bounds):
    s = bounds.interior(np.array([5.0, -5.0, 5.0, 2.45, 7.0]), 0.1)
    np.testing.assert_allclose(s, [0.9, 0.1, 2.7, 2.45, 7.0])


@pytest.mark.parametrize("seed", range(10))
def test_the_longest_step_uses_up_the_share_of_one_distance_and_no_more_of_any(bounds, s, seed):
    ds = 10.0 * np.random.default_rng(seed).normal(size=5)
    share = barrier.step_length(bounds, s, ds, 0.99)
    moved = s + share * ds
    low, high = bounds.has_low, bounds.has_high
    left = np.concatenate([(moved - LOW)[low] / (s - LOW)[low], (HIGH - moved)[high] / (HIGH - s)[high]])
    used = 1.0 - left
    assert used.max() == pytest.approx(0.99) if share < 1.0 else used.max() <= 0.99


def test_complementarity_on_the_central_path_is_mu(bounds, s):
    np.testing.assert_allclose(barrier.complementarity(bounds, s, *multipliers(bounds, s)), [MU, MU], rtol=1e-12)


def test_a_full_step_of_the_multipliers_solves_the_linearized_complementarity(bounds, s):
    z_low, z_high = multipliers(bounds, s)
    before_low, before_high, ds = z_low.copy(), z_high.copy(), np.full(5, 1e-4)
    barrier.update_multipliers(bounds, s, s + ds, ds, z_low, z_high, 0.9 * MU, 0.99)
    low, high = bounds.has_low, bounds.has_high
    np.testing.assert_allclose((z_low * (s - bounds.low) + before_low * ds)[low], 0.9 * MU, rtol=1e-12)
    np.testing.assert_allclose((z_high * (bounds.high - s) - before_high * ds)[high], 0.9 * MU, rtol=1e-12)


def test_multipliers_stay_positive_whatever_the_step(bounds, s):
    z_low, z_high = multipliers(bounds, s)
    ds = np.array([0.05, 0.5, 0.1, 0.2, 1.0])
    barrier.update_multipliers(bounds, s, s, 100.0 * ds, z_low, z_high, 1e-3, 0.99)
    assert np.all(z_low[bounds.has_low] > 0.0)
    assert np.all(z_high[bounds.has_high] > 0.0)


def test_residuals_are_maximum_norms_and_what_is_not_finite_stays_so():
    rng = np.random.default_rng(3)
    lagrangian, nu, z_low, z_high, c, gap = (rng.normal(size=n) for n in (7, 5, 5, 5, 4, 5))
    slope, violation = barrier.residuals(lagrangian, nu, z_low, z_high, c, gap)
    assert slope == np.abs([*lagrangian, *(nu + z_low - z_high)]).max()
    assert violation == np.abs([*c, *gap]).max()
    c[1] = np.nan
    assert np.isnan(barrier.residuals(lagrangian, nu, z_low, z_high, c, gap)[1])


def test_norm_1_is_the_sum_of_absolute_values():
    a = np.random.default_rng(4).normal(size=20)
    assert barrier.norm_1(a) == pytest.approx(np.abs(a).sum(), rel=1e-14)
