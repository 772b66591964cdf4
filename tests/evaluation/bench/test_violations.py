"""How much of known plans lies beyond the limits."""

from types import SimpleNamespace

import numpy as np
import pytest

from aerial_evaluation.bench.samples import Sample
from aerial_evaluation.bench.violations import violations, violations_to_json

TIME = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])  # [s], take-off until 0.4


def sample(torque, voltage, speed=None):
    """A plan of two joints whose ratios are ``(5, 2)``."""
    use = SimpleNamespace(
        torque_ratio=np.array(torque),
        voltage_ratio=np.array(voltage),
        speed_ratio=np.zeros((5, 2)) if speed is None else speed,
    )
    plan = SimpleNamespace(time=TIME, take_off_time=0.4)
    return Sample(report=None, cpu_time=0.0, result=SimpleNamespace(plan=plan, actuator_use=use))


WITHIN = np.full((5, 2), 0.5)
BEYOND = np.array([[0.5, 0.5], [1.1, 0.5], [0.5, 1.3], [0.5, 0.5], [0.5, 2.0]])  # the last one in flight


def test_take_off_and_flight_are_counted_apart():
    row = violations([sample(BEYOND, WITHIN)])
    assert (row["take_off"].samples, row["flight"].samples) == (8, 2)
    assert row["take_off"].worst_torque_ratio == pytest.approx(1.3)
    assert row["flight"].worst_torque_ratio == pytest.approx(2.0)


def test_shares_are_of_all_joints_at_all_intervals_of_all_plans():
    row = violations([sample(BEYOND, WITHIN), sample(WITHIN, WITHIN)])["take_off"]
    assert row.beyond == pytest.approx(2 / 16)
    assert row.far_beyond == pytest.approx(1 / 16)


def test_a_joint_beyond_two_limits_counts_once():
    row = violations([sample(BEYOND, BEYOND)])["take_off"]
    assert row.beyond == pytest.approx(2 / 8)
    assert row.worst_voltage_ratio == pytest.approx(1.3)


def test_refused_goals_have_none():
    refused = Sample(report=None, cpu_time=0.0, result=None)
    assert violations([refused]) == violations_to_json([refused]) == {"take_off": None, "flight": None}
    assert violations([refused, sample(WITHIN, WITHIN)])["take_off"].beyond == 0.0
