"""A plan between its knots, against what the numbers at the knots say."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.numerics import rotation
from aerial_model.values.plan import Plan

KNOTS, JOINTS, POINTS = 5, 3, 2
TIME = np.array([0.0, 0.1, 0.25, 0.3, 0.5])


@pytest.fixture
def plan():
    """A plan of random states; attitudes turn by less than half a turn from knot to knot."""
    random = np.random.default_rng(1)
    turns = random.normal(scale=0.4, size=(KNOTS, 3))
    orientation = [rotation.exp(turns[0])]
    for turn in turns[1:]:
        orientation.append(rotation.multiply(orientation[-1], rotation.exp(turn)))
    q = random.normal(size=(KNOTS, 7 + JOINTS))
    q[:, 3:7] = orientation
    return Plan(
        motion="made up",
        robot="made up",
        model_hash="",
        time=TIME,
        q=q,
        v=random.normal(size=(KNOTS, 6 + JOINTS)),
        com=random.normal(size=(KNOTS, 3)),
        com_velocity=random.normal(size=(KNOTS, 3)),
        angular_momentum=random.normal(size=(KNOTS, 3)),
        foot_position=random.normal(size=(KNOTS, POINTS, 3)),
        force=random.normal(size=(KNOTS, POINTS, 3)),
        contact=random.random((KNOTS, POINTS)) > 0.5,
        take_off_time=0.3,
        landing_time=0.5,
        landing_joint_position=np.zeros(JOINTS),
        landing_com_height=0.3,
        landing_support_centre=np.zeros(3),
        landing_yaw=0.0,
        rotation=np.zeros(3),
    )


@pytest.mark.parametrize("k", range(KNOTS - 1))
def test_at_a_knot_the_sample_is_the_knot(plan, k):
    sample = plan.sample(TIME[k])
    np.testing.assert_allclose(sample.q, plan.q[k], atol=1e-12)
    np.testing.assert_allclose(sample.v, plan.v[k], atol=1e-12)
    np.testing.assert_array_equal(sample.force, plan.force[k])
    np.testing.assert_array_equal(sample.contact, plan.contact[k])


@pytest.mark.parametrize("k", range(KNOTS - 1))
@pytest.mark.parametrize("share", [0.25, 0.8])
def test_between_knots_the_attitude_turns_at_a_constant_rate(plan, k, share):
    sample = plan.sample(TIME[k] + share * (TIME[k + 1] - TIME[k]))
    begin, end = (rotation.matrix(plan.q[i, 3:7]) for i in (k, k + 1))
    between = begin @ pin.exp3(share * pin.log3(begin.T @ end))
    np.testing.assert_allclose(rotation.matrix(sample.q[3:7]), between, atol=1e-9)


@pytest.mark.parametrize("time", [0.05, 0.2, 0.27, 0.45])
def test_rates_are_the_slopes_of_what_is_sampled(plan, time):
    h = 1e-6
    before, now, after = (plan.sample(t) for t in (time - h, time, time + h))
    np.testing.assert_allclose((after.v - before.v) / (2 * h), now.vdot, atol=1e-5)
    np.testing.assert_allclose((after.com_velocity - before.com_velocity) / (2 * h), now.com_acceleration, atol=1e-5)
    np.testing.assert_allclose(
        (after.angular_momentum - before.angular_momentum) / (2 * h), now.angular_momentum_rate, atol=1e-5
    )


@pytest.mark.parametrize(("time", "k"), [(-1.0, 0), (0.6, KNOTS - 1)])
def test_states_are_held_at_the_ends(plan, time, k):
    np.testing.assert_allclose(plan.sample(time).q, plan.q[k], atol=1e-12)


@pytest.mark.parametrize(("time", "k"), [(-1.0, 0), (0.0, 0), (0.0999, 0), (0.1, 1), (0.49, 3), (0.5, 3), (2.0, 3)])
def test_the_interval_of_a_time(plan, time, k):
    assert plan.interval(time) == k
