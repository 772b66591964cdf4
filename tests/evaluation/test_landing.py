"""The judge, on made-up histories: a perfect one passes, and each check has one that fails it and nothing else."""

import dataclasses
import json

import numpy as np
import pinocchio as pin
import pytest

from aerial_evaluation.judgement.landing import OBSERVE_TIME, judge
from aerial_evaluation.record import IncompleteRunError, Run, Tick
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, Robot
from aerial_model.values.frame import StartFrame
from aerial_model.values.plan import Plan
from aerial_sim.conditions import Conditions
from aerial_sim.ground_truth import GroundTruth

DT = 0.002  # [s]
START = 3.0  # [s]
TAKE_OFF, LANDING = 0.3, 0.6  # [s] from the start
ORIGIN = np.array([0.5, -0.2, 0.1])  # [m]
HEADING = 0.7  # [rad]
FRAME = StartFrame(origin=ORIGIN, heading=HEADING)
JUMP = np.array([0.3, 0.0, 0.0])  # [m]
TURN = 0.4  # [rad] about z
TWIST = TURN / LANDING  # [rad/s]


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture(scope="module")
def plan(robot):
    stance = robot.standing_configuration()
    landed = stance.copy()
    landed[BASE_ORIENTATION] = rotation.about_z(TURN)
    landed[:3] = rotation.matrix(rotation.about_z(TURN)) @ stance[:3] + JUMP
    n_c, nv = robot.n_contacts, robot.model.nv
    time = np.array([0.0, TAKE_OFF, LANDING])
    zeros = np.zeros((3, 3))
    return Plan(
        motion="jump",
        robot=robot.name,
        model_hash=robot.model_hash,
        time=time,
        q=np.array([stance, stance, landed]),
        v=np.zeros((3, nv)),
        com=zeros,
        com_velocity=zeros,
        angular_momentum=zeros,
        foot_position=np.zeros((3, n_c, 3)),
        force=np.zeros((3, n_c, 3)),
        contact=np.array([[True] * n_c, [False] * n_c, [False] * n_c]),
        take_off_time=TAKE_OFF,
        landing_time=LANDING,
        landing_joint_position=robot.poses["landing"],
        landing_com_height=pin.centerOfMass(robot.model, robot.model.createData(), stance)[2],
        landing_support_centre=JUMP,
        landing_yaw=TURN,
        rotation=np.array([0.0, 0.0, TURN]),
    ).checked(robot)


@pytest.fixture
def ticks(robot, plan):
    """A history that does exactly what the plan says, then stands."""
    placed = plan.placed(FRAME)
    n_c, n = robot.n_contacts, robot.n_joints
    history = []
    for t in np.arange(round((LANDING + OBSERVE_TIME) / DT) + 1) * DT:
        q = placed.q[0] if t < TAKE_OFF else placed.q[2]
        v = np.zeros(robot.model.nv)
        v[5] = TWIST if t < LANDING else 0.0
        history.append(
            Tick(
                truth=GroundTruth(
                    time=START + t,
                    q=q.copy(),
                    v=v,
                    contact=np.full(n_c, not TAKE_OFF < t < LANDING),
                    force=np.zeros((n_c, 3)),
                    other_contacts=(),
                    trunk_contact=False,
                    requested_torque=np.zeros(n),
                    delivered_torque=np.zeros(n),
                    peak_torque_ratio=0.9,
                    peak_voltage_ratio=0.8,
                )
            )
        )
    return history


@pytest.fixture
def verdict(robot, plan):
    def verdict(ticks, plan=plan, frame=FRAME):
        return judge(Run(robot=robot, plan=plan, start_frame=frame, start_time=START, ticks=ticks))

    return verdict


def changed(ticks, start, end, **changes):
    """The history with fields of the truth changed from ``start`` to ``end`` [s after the start of the motion]."""
    return [
        dataclasses.replace(tick, truth=dataclasses.replace(tick.truth, **changes))
        if start - DT / 2 <= tick.truth.time - START <= end + DT / 2
        else tick
        for tick in ticks
    ]


def moved(ticks, **changes):
    """The history with its last 0.1 s at another configuration or velocity."""
    return changed(ticks, LANDING + OBSERVE_TIME - 0.1, LANDING + OBSERVE_TIME, **changes)


def test_a_perfect_history_has_landed(verdict, ticks):
    result = verdict(ticks)
    assert result.landed
    assert result.failed == ()


def test_figures_of_a_perfect_history(verdict, ticks):
    result = json.loads(json.dumps(verdict(ticks).to_json()))
    assert result["tilt_deg"] == pytest.approx(0.0, abs=1e-5)
    assert result["position_error_m"] == pytest.approx(0.0, abs=1e-9)
    assert result["rotation_deg"] == pytest.approx([0.0, 0.0, np.degrees(TURN)], abs=0.1)
    assert result["height_m"] == pytest.approx(result["apex_m"])
    assert result["peak_torque_ratio"] == 0.9
    assert result["peak_voltage_ratio"] == 0.8


def test_too_short_a_flight_fails_airborne_alone(verdict, ticks):
    half = (TAKE_OFF + LANDING) / 2
    one_foot = np.array([True, False, False, False])
    assert verdict(changed(ticks, TAKE_OFF, half - 0.01, contact=one_foot)).landed
    # The rest of the flight is too short by one tick; the turn up to the touchdown stays the planned one.
    assert verdict(changed(ticks, TAKE_OFF, half + 0.002, contact=one_foot)).failed == ("airborne",)


def test_two_short_hops_are_no_flight(verdict, ticks):
    half = (TAKE_OFF + LANDING) / 2
    touching = np.ones(4, dtype=bool)
    hops = changed(changed(ticks, half - 0.03, half + 0.03, contact=touching), LANDING, LANDING, contact=touching)
    assert "airborne" in verdict(hops).failed


def test_a_robot_that_never_leaves_the_ground_has_not_landed(verdict, ticks):
    grounded = changed(ticks, 0.0, LANDING, contact=np.ones(4, dtype=bool))
    assert verdict(grounded).failed == ("airborne",)


def test_a_trunk_that_touches_for_one_tick_fails_trunk_clear_alone(verdict, ticks):
    assert verdict(changed(ticks, 0.5, 0.5, trunk_contact=True, other_contacts=("base",))).failed == ("trunk_clear",)


def test_a_shank_on_the_ground_after_settling_fails_feet_only_alone(verdict, ticks):
    touch = {"other_contacts": ("fl_shank",)}
    assert verdict(changed(ticks, LANDING, LANDING + 0.298, **touch)).landed
    assert verdict(changed(ticks, LANDING + 0.3, LANDING + 0.3, **touch)).failed == ("feet_only",)
    assert verdict(changed(ticks, LANDING + 1.5, LANDING + 1.5, **touch)).failed == ("feet_only",)


@pytest.mark.parametrize(("tilt", "holds"), [(9.9, True), (10.1, False)])
def test_tilt_beyond_ten_degrees_fails_upright_alone(verdict, ticks, tilt, holds, robot, plan):
    q = ticks[-1].truth.q.copy()
    support = robot.contact_positions(q).mean(axis=0)
    turn = rotation.exp(np.array([np.radians(tilt), 0.0, 0.0]))
    q[:3] = support + rotation.matrix(turn) @ (q[:3] - support)  # about the support: its centre stays
    q[BASE_ORIENTATION] = rotation.multiply(turn, q[BASE_ORIENTATION])
    result = verdict(moved(ticks, q=q))
    assert result.failed == (() if holds else ("upright",))
    assert result.tilt == pytest.approx(np.radians(tilt))


@pytest.mark.parametrize(("sink", "holds"), [(0.05, True), (0.06, False), (-0.05, True), (-0.06, False)])
def test_a_wrong_height_fails_height_alone(verdict, ticks, sink, holds):
    q = ticks[-1].truth.q - np.eye(19)[2] * sink
    assert verdict(moved(ticks, q=q)).failed == (() if holds else ("height",))


@pytest.mark.parametrize(("speed", "holds"), [(0.099, True), (0.101, False)])
def test_a_moving_base_fails_at_rest_alone(verdict, ticks, speed, holds):
    v = np.eye(18)[1] * speed
    assert verdict(moved(ticks, v=v)).failed == (() if holds else ("at_rest",))


@pytest.mark.parametrize(("missing", "holds"), [(14.9, True), (15.1, False)])
def test_a_missing_turn_fails_rotation_alone(verdict, ticks, missing, holds):
    slower = np.eye(18)[5] * (TURN - np.radians(missing)) / LANDING
    result = verdict(changed(ticks, 0.0, LANDING, v=slower))
    assert result.failed == (() if holds else ("rotation",))
    assert result.rotation_error == pytest.approx(np.radians(missing), abs=1e-3)


def test_a_full_turn_is_not_no_turn(verdict, ticks, plan):
    around = np.eye(18)[4] * 2 * np.pi / LANDING  # about y of the base
    result = verdict(changed(ticks, 0.0, LANDING - DT, v=around))
    assert np.linalg.norm(result.rotation) == pytest.approx(2 * np.pi, rel=0.03)
    assert result.failed == ("rotation",)


def test_turning_after_the_touchdown_does_not_count(verdict, ticks):
    later = changed(ticks, LANDING + 0.1, LANDING + 0.5, v=np.eye(18)[5] * 2.0)
    assert verdict(later).landed


@pytest.mark.parametrize(("miss", "holds"), [(0.094, True), (0.096, False)])
def test_landing_elsewhere_fails_position_alone(verdict, ticks, miss, holds):
    """0.05 m + 0.15 × 0.3 m = 0.095 m."""
    q = ticks[-1].truth.q + np.eye(19)[1] * miss
    result = verdict(moved(ticks, q=q))
    assert result.failed == (() if holds else ("position",))
    assert result.position_error == pytest.approx(miss)


def test_the_position_tolerance_is_capped(verdict, ticks, plan):
    far = dataclasses.replace(plan, landing_support_centre=np.array([1.2, 0.0, 0.0]))
    shift = rotation.matrix(rotation.about_z(HEADING)) @ [0.9 - 0.151, 0.0, 0.0]
    q = ticks[-1].truth.q.copy()
    q[:3] += shift
    assert verdict(moved(ticks, q=q), far).failed == ("position",)


@pytest.mark.parametrize("field", ["peak_torque_ratio", "peak_voltage_ratio"])
def test_more_than_one_per_cent_of_ticks_beyond_a_limit_fails_within_limits_alone(verdict, ticks, field):
    assert verdict(changed(ticks, 0.0, 9 * DT, **{field: 1.2})).landed
    result = verdict(changed(ticks, 0.0, 11 * DT, **{field: 1.2}))
    assert result.failed == ("within_limits",)
    assert getattr(result, field) == 1.2


def test_one_fallback_fails_no_fallback_alone(verdict, ticks):
    ticks[100] = dataclasses.replace(ticks[100], fallback=True)
    assert verdict(ticks).failed == ("no_fallback",)


def test_what_happens_before_or_after_does_not_count(verdict, ticks):
    bad = {"trunk_contact": True, "peak_torque_ratio": 5.0}
    before = [dataclasses.replace(ticks[0], truth=dataclasses.replace(ticks[0].truth, time=START - DT, **bad))]
    after = [
        dataclasses.replace(
            ticks[-1], truth=dataclasses.replace(ticks[-1].truth, time=ticks[-1].truth.time + DT, **bad)
        )
    ]
    result = verdict(before + ticks + after)
    assert result.landed
    assert result.peak_torque_ratio == 0.9


def test_a_history_that_ends_early_is_no_verdict(verdict, ticks):
    with pytest.raises(IncompleteRunError, match=r"judged from 3.000 s to 5.100 s; the true states cover 3.000 s to"):
        verdict(ticks[:-10])
    with pytest.raises(IncompleteRunError, match="no true states"):
        verdict([])


def test_the_start_heading_frame_is_the_robots_not_the_worlds(verdict, ticks):
    """A perfect history judged from another heading is off in place."""
    result = verdict(ticks, frame=StartFrame(origin=ORIGIN, heading=HEADING + 1.0))
    assert result.failed == ("position",)


def test_ground_that_rose_counts_for_the_height(robot, plan, ticks):
    """What stands 0.06 m higher than planned has not landed, unless the ground is where it stands."""
    q = ticks[-1].truth.q + np.eye(19)[2] * 0.06
    history = {"robot": robot, "plan": plan, "start_frame": FRAME, "start_time": START, "ticks": moved(ticks, q=q)}
    assert judge(Run(**history)).failed == ("height",)
    assert judge(Run(**history, conditions=Conditions(ground_rise=0.06))).landed
