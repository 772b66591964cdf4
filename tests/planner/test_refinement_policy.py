"""Which attempt follows which, with attempts whose outcomes are given."""

from types import SimpleNamespace

import numpy as np
import pytest

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.values.terrain import Terrain
from aerial_planner.assembly.checks import Shortfall
from aerial_planner.formulation.limits import Margin, Variant
from aerial_planner.refinement import Attempt, Outcome, Refinement

from .conftest import jump

REFUSED = RefusalError(RefusalCode.CHECK_FAILED, "rotation: 10° too much")
CLEAR = Shortfall(0.0, "")
APEX, HEIGHT = 0.5, 0.25  # of the centre of mass in every plan, and in the landing pose [m]


class Script:
    """Carries out attempts, checks their plans and improves on them as a list of events says."""

    def __init__(self, monkeypatch, *events):
        self.events, self.attempts = list(events), []
        self.robot = None
        self.log = SimpleNamespace(iterations=0, started_from="srbm")
        monkeypatch.setattr(Attempt, "improved", lambda attempt, outcome, *_: outcome.plan.event.get("better"))

    def carry_out(self, attempt):
        self.attempts.append(attempt)
        event = self.events.pop(0)
        self.log.iterations += event.get("iterations", 10)
        if "hopeless" in event:
            raise event["hopeless"]
        plan = SimpleNamespace(
            event=event, com=np.array([[0.0, 0.0, APEX]]), landing_com_height=HEIGHT, terrain=Terrain()
        )
        take_off = SimpleNamespace(flight_time=event.get("flight_time", 1.0))
        return Outcome(
            attempt=Attempt(request=attempt.request, margin=attempt.margin, take_off=take_off),
            from_a_plan=False,
            schedule=SimpleNamespace(flight_time_range=(0.3, 0.5)),
            reference=None,
            solution=SimpleNamespace(max_violation=0.0),
            plan=plan,
            use=None,
        )

    def check(self, plan, *_):
        if "refused" in plan.event:
            raise plan.event["refused"]

    def passes(self, plan, *_):
        return "refused" not in plan.event

    def shortfall(self, plan):
        return plan.event.get("shortfall", CLEAR)

    def best(self):
        return Refinement(first(), self.carry_out, self, Variant.AAKD_STAR, None, self.log).best().plan.event


def first(**said):
    return Attempt(request=jump(0.3, 0.0), margin=Margin(take_off=np.ones(1), flight=np.ones(1)), **said)


@pytest.fixture
def script(monkeypatch):
    return lambda *events: Script(monkeypatch, *events)


def test_an_outcome_that_nothing_betters_and_no_check_refuses_is_the_best(script):
    assert script({"name": "only"}).best()["name"] == "only"


def test_a_better_attempt_replaces_the_one_before(script):
    assert script({"better": first(rounds=1)}, {"name": "second"}).best()["name"] == "second"


@pytest.mark.parametrize("failure", [{"refused": REFUSED}, {"hopeless": REFUSED}], ids=["refused", "hopeless"])
def test_the_one_before_is_the_best_if_the_better_attempt_fails(script, failure):
    assert script({"name": "first", "better": first(rounds=1)}, failure).best()["name"] == "first"


def test_an_outcome_that_would_be_refused_is_nothing_to_fall_back_on(script):
    with pytest.raises(RefusalError, match="too much"):
        script({"better": first(rounds=1), "refused": REFUSED}, {"refused": REFUSED}).best()


def test_a_refused_optimum_with_the_shortest_flight_is_tried_from_another_start(script):
    tried = script({"refused": REFUSED, "flight_time": 0.3}, {"name": "cold"})
    assert tried.best()["name"] == "cold"
    assert [attempt.request.warm_start for attempt in tried.attempts] == [True, False]


def test_any_other_refusal_is_final(script):
    tried = script({"refused": REFUSED})
    with pytest.raises(RefusalError, match="too much"):
        tried.best()
    assert len(tried.attempts) == 1


def test_a_plan_that_does_not_clear_the_terrain_is_flown_higher(script):
    tried = script({"shortfall": Shortfall(0.03, "a foot would pass too low")}, {"name": "higher"})
    assert tried.best()["name"] == "higher"
    assert tried.attempts[1].least_rise == pytest.approx(APEX - HEIGHT + 0.03 + 0.01)


def test_after_too_many_iterations_nothing_higher_is_tried(script):
    low = {"shortfall": Shortfall(0.03, "a foot would pass too low"), "iterations": 60}
    tried = script(low, low, low)
    with pytest.raises(RefusalError, match="foot clearance: a foot would pass too low, also on a higher flight"):
        tried.best()
    assert len(tried.attempts) == 2
