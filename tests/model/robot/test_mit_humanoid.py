"""The humanoid is the one of its sources."""

import numpy as np
import pinocchio as pin
import pytest

from aerial_model.robot.robot import Robot


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mit_humanoid")


def of(robot, kind):
    return [j for j, name in enumerate(robot.joint_names) if kind in name]


@pytest.mark.parametrize(
    ("kind", "no_load", "full_torque_up_to"),
    [
        ("hip_yaw", 47.6, 35.5),
        ("hip_abad", 47.6, 35.5),
        ("hip_pitch", 39.7, 33.4),
        ("knee", 19.8, 16.7),
        ("ankle", 30.6, 22.8),
    ],
)
def test_motors_turn_as_fast_as_60_volts_let_them(robot, kind, no_load, full_torque_up_to):
    law, joints = robot.actuators, of(robot, kind)
    np.testing.assert_allclose(law.no_load_speed[joints], no_load, atol=0.05)
    corner = (law.bus_voltage - law.volts_per_torque * law.torque_max) / law.volts_per_speed
    np.testing.assert_allclose(corner[joints], full_torque_up_to, atol=0.1)


@pytest.mark.parametrize(
    ("name", "mass", "height"), [("mit_humanoid", 25.0, 0.562), ("mit_humanoid_46kg", 46.0, 0.614)]
)
def test_mass_and_centre_of_mass(name, mass, height):
    robot = Robot.load(name)
    q = robot.standing_configuration()
    assert robot.mass == pytest.approx(mass)
    assert pin.centerOfMass(robot.model, robot.model.createData(), q)[2] == pytest.approx(height, abs=0.002)
    assert q[2] == pytest.approx(0.576, abs=0.002)  # of the torso's origin over the soles


def test_left_and_right_mirror_each_other(robot):
    model, mirror = robot.model, np.diag([1.0, -1.0, 1.0])
    for name in model.names:
        if name.startswith("l_"):
            left, right = model.inertias[model.getJointId(name)], model.inertias[model.getJointId("r" + name[1:])]
            assert left.mass == right.mass
            np.testing.assert_allclose(left.lever, mirror @ right.lever, atol=1e-9)
            np.testing.assert_allclose(left.inertia, mirror @ right.inertia @ mirror, atol=1e-9)


def test_every_inertia_is_one_that_a_body_can_have(robot):
    for inertia in robot.model.inertias[1:]:
        principal = np.linalg.eigvalsh(inertia.inertia)
        assert principal[0] > 0
        assert principal[0] + principal[1] >= principal[2]


def test_its_arms_are_what_carries_no_contact_point(robot):
    assert {robot.joint_names[j] for j in robot.arms} == {
        f"{side}_{joint}" for side in "rl" for joint in ("shoulder_abad", "shoulder_pitch", "elbow")
    }
