"""How far a reach is looked for."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from aerial_evaluation.bench.reach import farthest
from aerial_evaluation.bench.reach_figure import End, draw
from aerial_model.errors import RefusalError
from aerial_model.values.request import MotionRequest

BOUND = 2.0
RESOLUTION = BOUND / 100


class Planning:
    """Plans up to 0.9 m, but for one goal on the way."""

    def plan(self, request):
        distance = request.displacement[0]
        if distance > 0.9 or distance == 0.5:
            refusal = RefusalError("out_of_reach", "too far")
            refusal.report = SimpleNamespace(refusal={"reason": f"{distance:.2f} m is too far"})
            raise refusal
        report = SimpleNamespace(peak_torque_ratio=0.5, peak_voltage_ratio=0.5, peak_speed_ratio=0.5)
        return SimpleNamespace(report=report)


def ahead(distance):
    return MotionRequest(motion="jump", displacement=np.array([distance, 0.0, 0.0]))


def test_a_single_goal_that_is_missed_is_not_the_end():
    distance, _ = farthest(Planning(), ahead, BOUND)
    assert distance == pytest.approx(0.9, abs=RESOLUTION)


def test_what_binds_is_said_just_beyond_the_reach():
    distance, binds = farthest(Planning(), ahead, BOUND)
    assert distance < float(binds.split()[0]) < distance + 2 * RESOLUTION


def test_the_map_shows_distance_by_direction_and_height_by_distance(tmp_path):
    end = End(direction_deg=0.0, on_platform=False, distance_m=1.0, height_m=0.0, binds="")
    flat = [replace(end, direction_deg=angle, distance_m=1.0 + angle / 360) for angle in (0.0, 90.0, 180.0)]
    raised = [replace(end, on_platform=True, distance_m=x, height_m=z) for x, z in ((0.8, 0.3), (1.2, 0.1))]
    around, ahead = draw([*flat, *raised], tmp_path / "reach.png").axes
    np.testing.assert_allclose(around.lines[0].get_xydata(), [[0.0, 1.0], [np.pi / 2, 1.25], [np.pi, 1.5]])
    np.testing.assert_allclose(ahead.lines[0].get_xydata(), [[0.8, 0.3], [1.2, 0.1]])
    assert (tmp_path / "reach.png").read_bytes().startswith(b"\x89PNG")
