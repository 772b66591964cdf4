"""How the controller's node tells that it keeps up."""

import numpy as np
import pytest

from aerial_wbic.ros.messages import WINDOW_TICKS, Pace


def test_one_slow_tick_in_a_hundred_is_in_the_99th_percentile_and_not_in_the_median():
    pace = Pace()
    pace.tick_times.extend([*([1e-4] * 97), *([5e-3] * 3)] * 5)
    assert pace.percentiles(50, 99, 100) == pytest.approx([1e-4, 5e-3, 5e-3])


def test_a_status_looks_back_on_more_ticks_than_a_percentile_needs():
    pace = Pace()
    pace.tick_times.extend(np.arange(3 * WINDOW_TICKS, dtype=float))
    assert WINDOW_TICKS >= 500
    assert pace.percentiles(0, 100) == [2.0 * WINDOW_TICKS, 3.0 * WINDOW_TICKS - 1]


def test_without_ticks_there_is_nothing_to_tell():
    assert Pace().percentiles(50, 99) == [0.0, 0.0]
