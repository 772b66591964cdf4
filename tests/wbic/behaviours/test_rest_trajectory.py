"""The trajectory to rest: its derivatives, its beginning, its end, and the figures its users rely on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerial_wbic.behaviours.rest_trajectory import REACH, TIME, sampled_trajectory, trajectory_to_rest

STEP = 1e-6  # of finite differences [s]
TIMES = np.linspace(0.0, 2.0, 2001)

numbers = st.floats(-2.0, 2.0)
rates = st.floats(2.0, 30.0)


def one_coordinate(x_0, xdot_0, x_f, rate):
    return trajectory_to_rest(np.array([x_0]), np.array([xdot_0]), np.array([x_f]), rate)


def at(trajectory, time):
    """Position, rate and acceleration of a trajectory of one coordinate."""
    return [part[0] for part in sampled_trajectory(trajectory, time)]


@given(numbers, numbers, numbers, rates, st.floats(0.01, 2.0))
def test_rate_and_acceleration_are_the_derivatives(x_0, xdot_0, x_f, rate, time):
    trajectory = one_coordinate(x_0, xdot_0, x_f, rate)
    before, here, after = (at(trajectory, t) for t in (time - STEP, time, time + STEP))
    assert here[1] == pytest.approx((after[0] - before[0]) / (2 * STEP), abs=1e-6)
    assert here[2] == pytest.approx((after[1] - before[1]) / (2 * STEP), abs=1e-4)


@given(numbers, numbers, numbers, rates)
def test_it_begins_as_told_without_acceleration(x_0, xdot_0, x_f, rate):
    x, xdot, xddot = at(one_coordinate(x_0, xdot_0, x_f, rate), 0.0)
    assert (x, xdot) == (pytest.approx(x_0), pytest.approx(xdot_0))
    assert xddot == pytest.approx(0.0, abs=1e-9)


@given(numbers, numbers, numbers, rates)
def test_it_is_at_rest_in_the_end(x_0, xdot_0, x_f, rate):
    x, xdot, _ = at(one_coordinate(x_0, xdot_0, x_f, rate), TIME / rate)
    assert abs(x - x_f) < 0.02 * abs(x_0 - x_f) + 0.03 * abs(xdot_0) / rate + 1e-12
    assert abs(xdot) < 0.1 * (rate * abs(x_0 - x_f) + abs(xdot_0)) + 1e-12


@given(st.floats(0.1, 3.0), rates)
def test_a_fall_reaches_the_depth_it_promises_and_hardly_swings_back(speed, rate):
    trajectory = one_coordinate(0.0, -speed, 0.0, rate)
    x, _, xddot = np.array([at(trajectory, time) for time in TIMES]).T
    assert x.min() == pytest.approx(-REACH * speed / rate, rel=0.01)
    assert xddot.max() == pytest.approx(0.80 * speed * rate, rel=0.01)
    assert xddot.min() > -0.08 * speed * rate


def test_every_component_has_its_own_rate():
    both = trajectory_to_rest(np.zeros(2), np.ones(2), np.zeros(2), np.array([5.0, 10.0]))
    one = one_coordinate(0.0, 1.0, 0.0, 10.0)
    np.testing.assert_allclose([part[1] for part in sampled_trajectory(both, 0.2)], at(one, 0.2))
