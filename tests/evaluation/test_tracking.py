"""Runs against their plans."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from aerial_evaluation.judgement.tracking import FIGURES, PHASES, SAMPLES, sampled, summary
from aerial_evaluation.record import Run, Tick
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ANGULAR, BASE_ORIENTATION, BASE_POSITION, Robot
from aerial_model.values.frame import StartFrame
from aerial_model.values.request import MotionRequest
from aerial_planner.planner import Planner
from aerial_sim.ground_truth import GroundTruth

ORIGIN, HEADING, START = np.array([1.0, -2.0, 0.0]), 0.7, 3.0
FRAME = StartFrame(origin=ORIGIN, heading=HEADING)
PERIOD = 0.002  # [s]
SHIFT, TURN = np.array([0.01, -0.02, 0.02]), np.array([0.0, 0.05, 0.0])


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture(scope="module")
def plan(robot):
    return Planner(robot).plan(MotionRequest(motion="jump", displacement=np.array([0.3, 0.0, 0.0]))).plan


def followed(robot, plan, change=lambda q, v: (q, v)):
    """The figures of a run that follows a plan but for a change of its state."""
    placed, n, n_c = plan.placed(FRAME), robot.n_joints, robot.n_contacts
    ticks = []
    for time in np.arange(-0.1, plan.landing_time + 1.0, PERIOD):
        wanted = placed.sample(time)
        q, v = change(wanted.q.copy(), wanted.v.copy())
        nothing = (np.zeros(n_c, dtype=bool), np.zeros((n_c, 3)), (), False, np.zeros(n), np.zeros(n), 0.0, 0.0)
        names = [f.name for f in dataclasses.fields(GroundTruth)]
        ticks.append(Tick(truth=GroundTruth(**dict(zip(names, (START + time, q, v, *nothing), strict=True)))))
    return sampled(Run(robot=robot, plan=plan, start_frame=FRAME, start_time=START, ticks=ticks))


def test_who_does_as_planned_is_off_by_nothing_until_touchdown(robot, plan):
    figures = followed(robot, plan)
    assert tuple(figures) == PHASES
    for phase in ("take_off", "flight"):
        assert {name: len(values) for name, values in figures[phase].items()} == dict.fromkeys(FIGURES, SAMPLES)
        assert max(figures[phase]["com_m"]) < 2e-3  # between knots the state is interpolated
        assert max(figures[phase]["attitude_deg"]) < 1e-5
        assert max(figures[phase]["angular_momentum"]) < 0.1


def test_a_shift_and_a_turn_are_found_as_they_are(robot, plan):
    def shifted(q, v):
        q[BASE_POSITION] += SHIFT
        return q, v

    def turned(q, v):
        q[BASE_ORIENTATION] = rotation.multiply(q[BASE_ORIENTATION], rotation.exp(TURN))
        return q, v

    flight = followed(robot, plan, shifted)["flight"]
    assert np.median(flight["com_m"]) == pytest.approx(np.linalg.norm(SHIFT), rel=0.05)
    assert followed(robot, plan, turned)["flight"]["attitude_deg"] == pytest.approx([np.rad2deg(0.05)] * SAMPLES)


def test_after_landing_all_turning_is_too_much(robot, plan):
    def turning(q, v):
        v[:] = 0.0
        v[BASE_ANGULAR] = [0.0, 1.0, 0.0]
        return q, v

    data = robot.model.createData()
    q, v = turning(plan.q[-1].copy(), plan.v[-1].copy())
    alpha = np.linalg.norm(pin.computeCentroidalMomentum(robot.model, data, q, v).angular)
    landing = followed(robot, plan, turning)["landing"]
    assert landing["angular_momentum"] == pytest.approx([alpha] * SAMPLES)
    assert max(landing["attitude_deg"]) < 1.0


def test_a_run_that_ends_before_a_phase_has_no_figures_of_it(robot, plan):
    assert sampled(Run(robot=robot, plan=plan, start_frame=FRAME, start_time=START, ticks=[])) == {}


def test_many_runs_are_pooled():
    runs = [{"flight": {name: [value] for name in FIGURES}} for value in (3.0, 4.0)]
    figures = summary([*runs, {}])
    assert tuple(figures) == ("flight",)
    assert figures["flight"].figures["com_m"].rms == pytest.approx(np.sqrt(12.5))
    assert figures["flight"].to_json()["attitude_deg"] == pytest.approx({"rms": np.sqrt(12.5), "p95": 3.95})
