"""``aerial bench loop``: what it goes through, what it says, what it refuses; the run itself needs a quiet machine."""

import itertools
import os
import time

import pytest

from aerial_operator.bench.loop import JUMPS, _in_turn, _processor_time, tables

FIGURES = {
    "seconds": 61.0,
    "control": {
        "rate_hz": 500.0,
        "ticks": 30_000,
        "missed_ticks": 60,
        "missed_share": 0.002,
        "late_ticks": 3,
        "round_trip_us": {"p50": 600.0, "p99": 1200.0, "max": 5000.0},
    },
    "processor_share": {"sim": 0.4, "wbic": 0.3, "planner": 0.1},
    "rows": [
        {
            "asked": "spin",
            "planning_time_s": 0.5,
            "landed": True,
            "checks": {"upright": True},
            "tilt_deg": 0.4,
            "tick_us": {"p99": 300.0},
        },
        {"asked": "jump left", "planning_time_s": 0.5, "checks": {}, "refusal": {"reason": "out of reach"}},
    ],
}


def test_every_motion_has_its_turn_and_then_again():
    names = [name for name, _ in itertools.islice(_in_turn(["jump", "spin"]), 2 * (len(JUMPS) + 1))]
    assert names == 2 * ["jump forward", "jump back", "jump left", "spin"]


def test_a_person_sees_missed_ticks_round_trip_and_each_motion():
    text = tables(FIGURES)
    assert "60 of 30000 (0.20 %)" in text
    assert "p50 600 µs, p99 1200 µs, max 5000 µs" in text
    assert "no, refused: out of reach" in text


def test_the_processor_time_of_a_process_is_that_it_took():
    before, began = _processor_time(os.getpid()), time.process_time()
    while time.process_time() - began < 0.2:
        pass
    assert _processor_time(os.getpid()) - before == pytest.approx(0.2, abs=0.1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["--seconds", "0"], "positive number"), (["--motions", "jmup"], "did you mean 'jump'")],
)
def test_a_loop_that_cannot_be_measured_is_one_sentence(aerial, tmp_path, arguments, words):
    ended = aerial("bench", "loop", "--out", tmp_path, *arguments)
    assert ended.status == 1
    assert words in ended.errors
    assert "Traceback" not in ended.errors
