import pytest

from aerial_ros.latency import LONGEST, RESOLUTION, Latency


def test_percentiles_are_right_to_the_resolution():
    latency = Latency()
    for microseconds in range(100, 1100):
        latency.add(microseconds * 1e-6)
    assert latency.percentile(50) == pytest.approx(600e-6, abs=2 * RESOLUTION)
    assert latency.percentile(99) == pytest.approx(1090e-6, abs=2 * RESOLUTION)


def test_nothing_measured_is_zero():
    assert Latency().percentile(99) == 0.0


def test_very_long_durations_are_capped():
    latency = Latency()
    latency.add(10.0)
    assert latency.percentile(50) == pytest.approx(LONGEST)
