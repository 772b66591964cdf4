"""The transition table: what may follow what, what is refused, and that who only asks changes nothing."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION
from aerial_wbic.behaviours.behaviour import Event, Setting
from aerial_wbic.behaviours.follow_plan import FollowPlan
from aerial_wbic.behaviours.land import Land
from aerial_wbic.behaviours.lie import Fold, Lie, Sink
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.behaviours.stand import Stand
from aerial_wbic.behaviours.stopped import Stopped
from aerial_wbic.behaviours.supervisor import EVERY, TRANSITIONS, Supervisor, transition_table

ARCHITECTURE = Path(__file__).parents[3] / "docs" / "architecture.md"
ASKED_FOR = (Event.PLAN_ACCEPTED, Event.ABORT, Event.LIE_DOWN, Event.STAND_UP)
NOBODY = np.zeros(4, dtype=bool)  # no point is felt


class Course:
    """A supervisor with a robot whose state is given, tick by tick."""

    def __init__(self, setting, state):
        self.supervisor = Supervisor(setting)
        self.time, self.state = 3.0, state
        self.tick()

    def tick(self, after=0.002):
        self.time += after
        self.supervisor.advance(self.time, NOBODY)
        self.supervisor.observe(self.state)
        return type(self.supervisor.behaviour)

    def ask(self, event, plan=None):
        self.supervisor.ask(event, plan)
        return type(self.supervisor.behaviour)


@pytest.fixture
def home(state_at):
    return state_at(moving=False)


@pytest.fixture
def course(robot, gains, home):
    return Course(Setting(robot=robot, gains=gains, home_height=float(home.com[2])), home)


@pytest.fixture
def brought_to(course, hop):
    """A course in which a behaviour runs."""

    def brought_to(behaviour):
        if behaviour in (FollowPlan, Land):
            course.ask(Event.PLAN_ACCEPTED, hop)
            course.tick()
        if behaviour is Land:
            course.tick(hop.landing_time)
        if behaviour in (Sink, Lie, Fold):
            course.ask(Event.LIE_DOWN)
            course.tick()
        if behaviour in (Lie, Fold):
            course.tick(10.0)
        if behaviour is Fold:
            course.ask(Event.STAND_UP)
            course.tick()
        if behaviour is Stopped:
            course.ask(Event.STOP)
            course.tick()
        assert type(course.supervisor.behaviour) is behaviour
        return course

    return brought_to


def test_the_documented_table_is_the_codes():
    assert transition_table() in ARCHITECTURE.read_text()


def test_no_two_rows_say_what_follows_on_the_same_event():
    keys = [(behaviour, row.event) for row in TRANSITIONS for behaviour in row.behaviours]
    assert len(keys) == len(set(keys))


def test_every_behaviour_can_be_entered_and_left():
    assert {row.follower for row in TRANSITIONS} == set(EVERY)
    assert {behaviour for row in TRANSITIONS for behaviour in row.behaviours} == set(EVERY)


@pytest.mark.parametrize("behaviour", EVERY)
@pytest.mark.parametrize("event", ASKED_FOR)
def test_what_the_table_has_no_row_for_is_refused_and_changes_nothing(brought_to, hop, behaviour, event):
    supervisor = brought_to(behaviour).supervisor
    if any(row.event is event and behaviour in row.behaviours for row in TRANSITIONS):
        return
    with pytest.raises(RefusalError):
        supervisor.ask(event, hop)
    assert type(supervisor.behaviour) is behaviour


@pytest.mark.parametrize("event", ASKED_FOR)
def test_a_stopped_robot_refuses_all_for_the_stops_sake(brought_to, hop, event):
    with pytest.raises(RefusalError) as caught:
        brought_to(Stopped).supervisor.ask(event, hop)
    assert caught.value.code is RefusalCode.STOPPED


@pytest.mark.parametrize("behaviour", EVERY)
@pytest.mark.parametrize(("event", "follower"), [(Event.STOP, Stopped), (Event.RESET, Stand)])
def test_stop_and_reset_are_done_whatever_runs(brought_to, behaviour, event, follower):
    assert brought_to(behaviour).ask(event) is follower


@pytest.mark.parametrize("behaviour", [Stand, Land, Sink])
def test_who_tilts_too_far_lets_go(brought_to, robot, gains, behaviour, state_at):
    course = brought_to(behaviour)
    course.state = state_at(moving=False)
    course.state.R_WB[:] = rotation.matrix(rotation.exp(np.array([gains.fall_tilt + 0.1, 0.0, 0.0])))
    assert course.tick() is Lie
    assert course.supervisor.target(course.state) is None
    with pytest.raises(RefusalError) as caught:
        course.ask(Event.STAND_UP)
    assert caught.value.code is RefusalCode.FELL


def test_a_motion_lands_at_the_plans_height_and_stands_there(brought_to, hop):
    course = brought_to(Land)
    assert course.supervisor.plan_run.plan is hop
    assert course.tick(10.0) is Stand
    assert course.supervisor.plan_run is None
    assert course.supervisor.behaviour.com_height == hop.landing_com_height


def test_who_does_not_come_to_the_height_at_rest_lets_go(brought_to, state_at):
    course = brought_to(Land)
    course.state = state_at(moving=False)
    course.state.com[2] *= 0.5
    assert course.tick(10.0) is Lie


def test_a_motion_that_is_called_off_lands_without_its_plan(brought_to):
    course = brought_to(FollowPlan)
    assert course.ask(Event.ABORT) is Land
    assert course.supervisor.plan_run is None
    assert course.tick(10.0) is Land  # it begins only now
    assert course.tick(10.0) is Stand


def test_it_is_too_late_to_abort_when_a_point_is_to_leave_the_ground(brought_to, hop):
    course = brought_to(FollowPlan)
    course.tick(hop.take_off_time)
    with pytest.raises(RefusalError) as caught:
        course.ask(Event.ABORT)
    assert caught.value.code is RefusalCode.BUSY


def test_it_rises_from_folded_legs(brought_to):
    course = brought_to(Fold)
    assert course.tick(10.0) is Land
    assert course.tick(10.0) is Stand


def test_a_second_plan_is_refused_until_the_first_has_come_to_rest(brought_to, hop):
    with pytest.raises(RefusalError, match="'hop' still runs") as caught:
        brought_to(Land).ask(Event.PLAN_ACCEPTED, hop)
    assert caught.value.code is RefusalCode.BUSY


@pytest.mark.parametrize(
    ("behaviour", "phase"),
    [
        (Stand, Phase.STAND),
        (FollowPlan, Phase.TAKE_OFF),
        (Land, Phase.LANDING),
        (Sink, Phase.LIE),
        (Lie, Phase.LIE),
        (Fold, Phase.LIE),
        (Stopped, Phase.STOPPED),
    ],
)
def test_a_phase_is_reported_of_every_behaviour(brought_to, behaviour, phase):
    assert brought_to(behaviour).supervisor.phase is phase


@pytest.mark.parametrize("behaviour", EVERY)
def test_who_only_asks_changes_nothing(brought_to, behaviour):
    """Asked twice, at times that come and go, a behaviour gives the same answers."""
    course = brought_to(behaviour)
    running, now, later = course.supervisor.behaviour, course.time, course.time + 20.0

    def answers():
        target = copy.deepcopy(running.target(now, course.state))
        return running.phase(now), running.contact(now).tolist(), running.observed(now, course.state), target

    first = answers()
    running.scheduled(later, NOBODY), running.observed(later, course.state), running.target(later, course.state)
    second = answers()
    assert first[:3] == second[:3]
    np.testing.assert_equal(first[3], second[3])
    assert course.supervisor.behaviour is running


def test_a_base_that_lies_on_its_side_is_told_by_its_attitude(home, gains):
    """The tilt is the angle between the base's z axis and the vertical: cos is what the table's condition compares."""
    q = rotation.exp(np.array([0.4, 0.0, 0.0]))
    assert np.cos(rotation.tilt(q)) == pytest.approx(rotation.matrix(q)[2, 2])
    assert rotation.tilt(home.q[BASE_ORIENTATION]) < gains.fall_tilt
