"""From a request to a plan or a refusal: motions, starts, variants, solvers, and what is said about them."""

import dataclasses

import numpy as np
import pytest
import yaml

from aerial_model.errors import RefusalCode, RefusalError
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, Robot
from aerial_model.values.estimate import Estimate
from aerial_model.values.frame import StartFrame
from aerial_model.values.request import MotionRequest
from aerial_model.values.terrain import Terrain
from aerial_planner.ocp.options import SolverName
from aerial_planner.planner import Planner

from .conftest import jump

G = np.array([0.0, 0.0, -9.81])
POSITION_TOLERANCE = 1e-4  # [m]
FOOT_TOLERANCE = 0.01  # of the landing feet's centre: they hang from a body that may be half a degree off level [m]
FORCE_FROM_NOWHERE = 0.1  # of the weight; with (3.8) at the knots a roll needed 0.33
MOMENTUM_TOLERANCE = 1e-4  # [kg·m²/s]
REFUSAL_ITERATIONS = 80  # that a refusal may take; an iteration is some 15 ms

TURNS = [
    ("spin left", "spin", 0.5, [0.0, 0.0, 180.0]),
    ("spin right", "spin", -0.5, [0.0, 0.0, -180.0]),
    ("quarter spin", "spin", 0.25, [0.0, 0.0, 90.0]),
    ("roll right", "barrel_roll", 1.0, [360.0, 0.0, 0.0]),
    ("roll left", "barrel_roll", -1.0, [-360.0, 0.0, 0.0]),
    ("front flip", "front_flip", None, [0.0, 360.0, 0.0]),
    ("back flip", "back_flip", None, [0.0, -360.0, 0.0]),
]


@pytest.mark.parametrize(("motion", "turns", "degrees"), [t[1:] for t in TURNS], ids=[t[0] for t in TURNS])
def test_a_turning_motion_accumulates_its_turns_and_lands_level(planner, motion, turns, degrees):
    plan = planner.plan(MotionRequest(motion=motion, rotation=turns)).plan
    axis = np.array(degrees) / np.linalg.norm(degrees)
    assert np.rad2deg(plan.rotation @ axis) == pytest.approx(np.linalg.norm(degrees), abs=8.0)
    assert np.rad2deg(rotation.tilt(plan.landing_pose[BASE_ORIENTATION])) < 3.0


def test_a_front_flip_leaves_the_ground_last_from_its_front_feet(planner, robot):
    plan = planner.plan(MotionRequest(motion="front_flip")).plan
    last = plan.contact[np.searchsorted(plan.time, plan.take_off_time - 1e-9) - 1]
    assert [point.name for point, on in zip(robot.contact_points, last, strict=True) if on] == ["fr", "fl"]


def test_a_roll_to_the_other_side_lands_on_the_other_side(planner):
    right, left = (planner.plan(MotionRequest(motion="barrel_roll", rotation=turns)).plan for turns in (1.0, -1.0))
    np.testing.assert_allclose(left.landing_support_centre, right.landing_support_centre * [1, -1, 1])


def test_the_same_request_gives_the_same_plan_to_the_last_bit(planner, forward):
    again = planner.plan(jump(0.4, 0.0)).plan
    np.testing.assert_array_equal(again.q, forward.plan.q)
    np.testing.assert_array_equal(again.force, forward.plan.force)


def test_a_plan_starts_where_the_robot_stands(planner, robot):
    q = robot.standing_configuration()
    rng = np.random.default_rng(3)
    q[7:] += rng.uniform(-0.02, 0.02, 12)
    q[:3] += [2.0, -1.0, 0.16]
    q[3:7] = rotation.multiply(rotation.about_z(2.0), q[3:7])
    plan = planner.plan(jump(0.3, 0.0), Estimate(time=0.0, q=q, v=np.zeros(18))).plan
    np.testing.assert_allclose(plan.q[0, 7:], q[7:], atol=1e-6)
    feet = plan.placed(StartFrame.of(robot, q)).foot_position[0]
    np.testing.assert_allclose(feet, robot.contact_positions(q), atol=1e-6)


@pytest.mark.parametrize("yaw", [-1.7, 3.1])
def test_either_quaternion_of_the_start_attitude_gives_the_same_plan(planner, robot, yaw):
    q = robot.standing_configuration()
    q[BASE_ORIENTATION] = rotation.about_z(yaw)
    opposite = q.copy()
    opposite[BASE_ORIENTATION] *= -1
    plans = [planner.plan(jump(0.3, 0.0), Estimate(time=0.0, q=start, v=np.zeros(18))).plan for start in (q, opposite)]
    np.testing.assert_allclose(plans[0].com, plans[1].com, atol=POSITION_TOLERANCE)


ELBOWS, ABAD, SHOULDERS = (["l_" + name, "r_" + name] for name in ("elbow", "shoulder_abad", "shoulder_pitch"))


@pytest.mark.parametrize(
    ("held", "weak", "torque"),
    [(ELBOWS + ABAD + SHOULDERS, "shoulder_pitch", 0.8), (ELBOWS + ABAD, "elbow", 0.5)],
    ids=["no arm moves", "arms swing"],
)
def test_held_joints_stay_at_home_and_are_not_asked_for_more_than_they_can_hold(tmp_path, held, weak, torque):
    """At the legs' usual pace the flight would take 1.2 N·m of each shoulder, 0.6 of each elbow."""
    said = {"extends": "mit_humanoid", "held_joints": held, "actuators": {weak: {"torque_max": torque}}}
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(said))
    robot = Robot.load(tmp_path)
    result = Planner(robot, actuator_tolerance=np.inf).plan(jump(0.3, 0.0))
    plan, use = result.plan, result.actuator_use
    home = robot.poses["home"][robot.held_joints]
    np.testing.assert_array_equal(plan.q[:, 7:][:, robot.held_joints], np.tile(home, (len(plan.q), 1)))
    assert not plan.v[:, 6:][:, robot.held_joints].any()
    assert use.torque_ratio.max() <= 1.05
    assert use.torque_ratio[:, robot.joint_names.index(f"l_{weak}")].max() > 0.5  # it is what binds


@pytest.mark.parametrize("binding", [(), ("friction",)])
def test_a_single_rigid_body_that_goes_astray_refuses_a_goal_only_if_something_binds_it(planner, monkeypatch, binding):
    """Some spins have it tumble, however near the goal."""
    body = type(planner._stages.srbm)
    solve = body.solve

    def astray(self, *request):
        guess, solution = solve(self, *request)
        return guess, dataclasses.replace(solution, converged=False, binding=binding)

    monkeypatch.setattr(body, "solve", astray)
    if binding:
        with pytest.raises(RefusalError, match="what binds: friction"):
            planner.plan(jump(0.4, 0.0))
    else:
        assert planner.plan(jump(0.4, 0.0)).report.started_from == "reference"


@pytest.mark.parametrize("variant", ["KD", "AAKD", "AAKD*"])
@pytest.mark.parametrize("warm_start", [True, False])
def test_every_variant_finds_the_same_easy_jump(planner, forward, variant, warm_start):
    plan = planner.plan(jump(0.4, 0.0, variant=variant, warm_start=warm_start)).plan
    np.testing.assert_allclose(plan.com, forward.plan.com, atol=5e-3)


@pytest.mark.parametrize("solver", [SolverName.FATROP, SolverName.IPOPT])
def test_other_solvers_find_the_same(robot, forward, solver):
    plan = Planner(robot, solver=solver).plan(jump(0.4, 0.0)).plan
    np.testing.assert_allclose(plan.com, forward.plan.com, atol=1e-4)


@pytest.mark.parametrize(
    ("wanted", "code", "sentence"),
    [
        (MotionRequest(motion="jmp"), RefusalCode.UNKNOWN_MOTION, "did you mean 'jump'"),
        (MotionRequest(motion="j" * 300), RefusalCode.UNKNOWN_MOTION, "unknown motion"),
        (MotionRequest(motion="../motions/jump"), RefusalCode.UNKNOWN_MOTION, "unknown motion"),
        (jump(3.0, 0.0), RefusalCode.NO_SOLUTION, "binds: .*(friction|torque|voltage)"),
        (jump(10.0, 0.0), RefusalCode.OUT_OF_REACH, "single rigid body"),
        (jump(40.0, 0.0), RefusalCode.OUT_OF_REACH, "out of reach"),
        (jump(0.0, 2.0), RefusalCode.NO_SOLUTION, "binds: .*(torque|voltage)"),
        (
            jump(0.6, 0.0, 2.0, terrain=Terrain.platform(2.0, 0.3, 0.0)),
            RefusalCode.NO_SOLUTION,
            "binds: .*(voltage|torque)",
        ),
        (
            jump(0.6, 0.0, 0.5, terrain=Terrain.platform(0.5, 0.3, 0.0)),
            RefusalCode.NO_SOLUTION,
            "binds: .*(voltage|torque)",
        ),
        (jump(0.3, 0.0, 0.16, terrain=Terrain.platform(0.16, 0.25, 0.0)), RefusalCode.CHECK_FAILED, "platform edge"),
        (
            jump(0.5, 0.0, terrain=Terrain.gap(0.2, 0.25, 0.0)),
            RefusalCode.CHECK_FAILED,
            "foot h[lr] would land at x 0.31",
        ),
        (
            jump(0.9, 0.0, terrain=Terrain.gap(0.2, 0.15, 0.0)),
            RefusalCode.INVALID_REQUEST,
            "foot f[lr] stands at x 0.19",
        ),
        (jump(0.4, 0.0, 0.16), RefusalCode.INVALID_REQUEST, "the ground there is 0.00 m"),
        (MotionRequest(motion="jump", rotation=0.5), RefusalCode.INVALID_REQUEST, "no rotation to set"),
        (jump(0.3, 0.0, variant="AKD"), RefusalCode.INVALID_REQUEST, "unknown variant 'AKD'"),
    ],
)
def test_a_goal_that_cannot_be_is_refused_with_the_reason(planner, wanted, code, sentence):
    with pytest.raises(RefusalError, match=sentence) as refusal:
        planner.plan(wanted)
    assert refusal.value.code is code
    assert refusal.value.report.iterations < REFUSAL_ITERATIONS
    assert refusal.value.report.refusal == {"code": code.value, "reason": refusal.value.reason}


def test_what_a_plan_asks_of_the_actuators_can_be_seen_instead_of_refused(robot):
    blind = jump(0.4, 0.0, variant="KD")
    with pytest.raises(RefusalError, match="% of its limit"):
        Planner(robot, actuator_tolerance=0.1).plan(blind)
    assert Planner(robot, actuator_tolerance=np.inf).plan(blind).report.peak_torque_ratio > 0.1
