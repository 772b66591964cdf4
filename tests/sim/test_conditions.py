"""Each condition changes the world as its name says, and nothing else."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aerial_model.kinematics import Kinematics
from aerial_model.robot.robot import BASE_POSITION, Robot
from aerial_model.values.command import Command
from aerial_sim.conditions import Conditions
from aerial_sim.simulation import Simulation

TORQUE = 5.0  # [N·m]


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


def torque(robot, value):
    still = np.zeros(robot.n_joints)
    return Command(
        torque=np.full(robot.n_joints, value), position=still, velocity=still, stiffness=still, damping=still
    )


def holding(robot):
    n = robot.n_joints
    return Command(
        torque=np.zeros(n),
        position=robot.poses["home"],
        velocity=np.zeros(n),
        stiffness=np.full(n, 100.0),
        damping=np.full(n, 2.0),
    )


@pytest.mark.parametrize(("latency", "arrives_in_tick"), [(0.0, 1), (0.002, 2), (0.006, 4)])
def test_a_command_acts_after_the_latency(robot, latency, arrives_in_tick):
    simulation = Simulation(robot, noise="off", conditions=Conditions(latency=latency))
    simulation.step(torque(robot, 0.0))
    delivered = [simulation.step(torque(robot, TORQUE)).joint_torque[0] for _ in range(5)]
    expected = [0.0] * (arrives_in_tick - 1) + [TORQUE] * (6 - arrives_in_tick)
    np.testing.assert_allclose(delivered, expected)


def test_half_a_period_of_latency_is_half_a_period(robot):
    simulation = Simulation(robot, noise="off", conditions=Conditions(latency=0.001))
    simulation.step(torque(robot, 0.0))
    assert simulation.step(torque(robot, TORQUE)).joint_torque[0] == pytest.approx(TORQUE / 2)


def test_lost_commands_leave_the_last_in_force(robot):
    simulation = Simulation(robot, noise="off", seed=3, conditions=Conditions(lost_commands=0.5))
    simulation.step(torque(robot, 0.0))
    asked = np.linspace(0.01, 0.05, 40)  # [N·m], too little to move anything fast
    delivered = [simulation.step(torque(robot, value)).joint_torque[0] for value in asked]
    new = np.isclose(delivered, asked)
    assert 0.25 < new.mean() < 0.75
    for k in range(1, 40):
        assert new[k] or delivered[k] == delivered[k - 1]


def test_noise_is_the_same_with_and_without_losses(robot):
    readings = [
        Simulation(robot, seed=3, conditions=conditions).step(torque(robot, 0.0)).joint_velocity
        for conditions in (Conditions(), Conditions(lost_commands=0.5))
    ]
    np.testing.assert_array_equal(*readings)


def test_a_weak_battery_gives_less_at_speed(robot):
    simulation = Simulation(robot, noise="off", conditions=Conditions(battery=0.5))
    q, v = simulation.state()
    v[6:] = 0.45 * robot.actuators.no_load_speed
    simulation.set_state(q, v)
    simulation.step(torque(robot, 15.0))
    truth = simulation.ground_truth()
    assert truth.delivered_torque.max() < 15.0
    assert truth.peak_voltage_ratio > 1.0


def test_a_battery_sags_under_load_only(robot):
    def delivered(value, resistance):
        simulation = Simulation(robot, noise="off", conditions=Conditions(battery_resistance=resistance))
        q, v = simulation.state()
        v[6:] = 0.6 * robot.actuators.no_load_speed
        simulation.set_state(q, v)
        simulation.step(torque(robot, value))
        return simulation.ground_truth().delivered_torque.mean()

    assert delivered(15.0, 0.02) < 0.98 * delivered(15.0, 0.0)
    assert delivered(0.0, 0.02) == delivered(0.0, 0.0)


@pytest.mark.parametrize("mass", [0.9, 1.1])
def test_the_feet_bear_the_mass(robot, mass):
    simulation = Simulation(robot, noise="off", conditions=Conditions(mass=mass))
    for _ in range(500):
        simulation.step(holding(robot))
    assert simulation.ground_truth().force[:, 2].sum() == pytest.approx(mass * robot.mass * 9.81, rel=0.01)


@pytest.mark.parametrize("rise", [-0.03, 0.03])
def test_the_robot_comes_to_stand_on_the_ground_where_it_is(robot, rise):
    heights = []
    for ground_rise in (0.0, rise):
        simulation = Simulation(robot, noise="off")
        q, v = simulation.state()
        q[2] += 0.05
        simulation.set_state(q, v)
        simulation.disturb(ground_rise=ground_rise)
        for _ in range(1000):
            simulation.step(holding(robot))
        heights.append(Kinematics(robot).at(*simulation.state()).contact_positions[:, 2])
    np.testing.assert_allclose(heights[1] - heights[0], rise, atol=1e-4)


@pytest.mark.parametrize("step", [0.00025, 0.001])
def test_a_finer_physics_step_makes_the_ground_harder(robot, step):
    sinking = []
    for physics_step in (step, step / 2):
        simulation = Simulation(robot, noise="off", conditions=Conditions(physics_step=physics_step))
        for _ in range(500):
            simulation.step(holding(robot))
        q, _ = simulation.state()
        sinking.append(robot.contact_points[0].radius - robot.contact_positions(q)[:, 2].min())
    assert 0 < sinking[1] < 0.3 * sinking[0]


def test_nothing_changes_without_conditions(robot):
    runs = []
    for conditions in (Conditions(), Conditions(push=1.0, ground_rise=0.02)):  # the last two are the runner's
        simulation = Simulation(robot, seed=1, conditions=conditions)
        for _ in range(20):
            simulation.step(holding(robot))
        runs.append(simulation.state()[0][BASE_POSITION])
    np.testing.assert_array_equal(*runs)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mass", 0.0),
        ("friction", -0.1),
        ("battery", 0.0),
        ("latency", -1e-3),
        ("lost_commands", 1.0),
        ("physics_step", 0.0),
    ],
)
def test_what_cannot_be_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        dataclasses.replace(Conditions(), **{name: value})
