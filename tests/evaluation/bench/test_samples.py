"""What many measured requests amount to."""

import pytest

from aerial_evaluation.bench.samples import Sample, measure, percentiles, summary
from aerial_model.errors import RefusalError
from aerial_model.values.request import MotionRequest
from aerial_planner.report import PlanReport

TIMES = [0.1 * k for k in range(1, 22)]  # 0.1 … 2.1 s


def sample(time, *, solved=True, peak=0.5, reason="too far"):
    figures = dict.fromkeys(PlanReport.__dataclass_fields__) | {
        "total_time_s": time,
        "srbm_time_s": 0.1 * time,
        "solve_time_s": 0.5 * time,
        "iterations": 20,
        "peak_torque_ratio": peak,
        "peak_voltage_ratio": 0.2,
        "peak_speed_ratio": 0.1,
        "refusal": None if solved else {"code": "out_of_reach", "reason": reason},
    }
    report = PlanReport(**figures)
    return Sample(report=report, cpu_time=time, result=object() if solved else None)


def test_percentiles_are_interpolated():
    assert percentiles(TIMES) == pytest.approx({"p50": 1.1, "p95": 2.0})
    assert percentiles([]) is None


def test_times_are_those_of_solved_requests():
    found = summary([sample(1.0), sample(3.0), sample(9.0, solved=False)])
    assert (found.trials, found.solved, found.accepted) == (3, 2, 2)
    assert found.total_time.p50 == 2.0
    assert found.refused_time.p50 == 9.0
    assert found.refusals == (("too far", 1),)


def test_a_plan_beyond_the_actuators_is_solved_but_not_accepted():
    found = summary([sample(1.0, peak=1.2)])
    assert (found.solved, found.accepted) == (1, 0)
    assert found.peak_torque_ratio == 1.2


def test_nothing_solved_has_no_times():
    row = summary([sample(1.0, solved=False)]).to_json()
    assert row["total_time_s"] is None
    assert row["peak_torque_ratio"] is None
    assert row["refusals"] == [{"reason": "too far", "times": 1}]


class Refusing:
    def plan(self, request):
        refusal = RefusalError("out_of_reach", "too far")
        refusal.report = sample(1.0, solved=False).report
        raise refusal


def test_a_refusal_is_a_sample_too():
    measured = measure(Refusing(), MotionRequest(motion="jump"))
    assert not measured.solved
    assert measured.report.refusal["reason"] == "too far"
