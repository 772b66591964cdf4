"""What the filter accepts, and that it never accepts what it has forbidden."""

import numpy as np
import pytest

from aerial_planner.ocp.filter import Filter, Merit

PRESENT = Merit(theta=1.0, phi=10.0)


def test_less_violation_at_equal_cost_is_accepted():
    assert Filter(1.0).accepts(Merit(0.5, 10.0), PRESENT, 1.0, 1.0)


def test_less_cost_at_equal_violation_is_accepted():
    assert Filter(1.0).accepts(Merit(1.0, 9.0), PRESENT, 1.0, 1.0)


def test_more_of_both_is_refused():
    assert not Filter(1.0).accepts(Merit(1.1, 10.1), PRESENT, 1.0, 1.0)


@pytest.mark.parametrize("trial", [Merit(np.nan, 0.0), Merit(0.0, np.nan), Merit(0.0, np.inf), Merit(1e5, 0.0)])
def test_what_is_not_finite_or_violates_far_too_much_is_refused(trial):
    assert not Filter(1.0).accepts(trial, PRESENT, 1.0, -1.0)


def test_a_feasible_point_must_descend_by_a_share_of_the_directional_derivative():
    feasible = Merit(0.0, 10.0)
    assert Filter(1.0).accepts(Merit(0.0, 10.0 - 1e-6), feasible, 1.0, -1.0)
    assert not Filter(1.0).accepts(Merit(0.0, 10.0 + 1e-6), feasible, 1.0, -1.0)


def test_the_point_that_was_left_for_less_violation_is_not_returned_to():
    entries = Filter(1.0)
    assert entries.accepts(Merit(0.1, 20.0), PRESENT, 1.0, 1.0)
    assert not entries.accepts(PRESENT, Merit(0.1, 20.0), 1.0, -1e9)


def test_a_cleared_filter_forbids_nothing():
    entries = Filter(1.0)
    entries.accepts(Merit(0.1, 20.0), PRESENT, 1.0, 1.0)
    entries.clear()
    assert entries.accepts(PRESENT, Merit(0.1, 20.0), 1.0, 1.0)


def test_a_step_that_descends_enough_adds_nothing_to_the_filter():
    """Otherwise points of little violation would be forbidden on the way to the optimum."""
    entries, nearly_feasible = Filter(1.0), Merit(1e-3, 10.0)
    assert entries.accepts(Merit(1e-3, 9.0), nearly_feasible, 1.0, -1.0)
    assert entries.accepts(nearly_feasible, Merit(1.0, 20.0), 1.0, -1.0)
