"""Contacts felt by the joints, and flights that they end."""

from __future__ import annotations

import numpy as np
import pytest

from aerial_model.kinematics import Kinematics
from aerial_model.robot.robot import JOINT_VELOCITY
from aerial_sim.conditions import Conditions
from aerial_sim.simulation import Simulation
from aerial_wbic.behaviours.phase import Phase
from aerial_wbic.controller import Controller
from aerial_wbic.estimation.touchdown import ContactSense
from aerial_wbic.gains import TouchdownSensing

PERIOD = 0.002  # [s]
STAND_TIME = 0.5  # [s]
DELAY = 0.004  # from half of the points on the ground to the landing [s]
STICTION_SPEED = 0.5  # [rad/s]


@pytest.fixture
def sense(robot):
    return ContactSense(robot, TouchdownSensing(filter_time=PERIOD), STICTION_SPEED)


def held(robot, force):
    """A robot held at rest, and the torques that bear ``force`` ``(n_c, 3)`` [N] on its contact points."""
    state = Kinematics(robot).at(robot.standing_configuration(), np.zeros(robot.model.nv))
    bearing = np.einsum("iab,ia->b", state.J_contacts, force)
    return state, (state.nle - bearing)[JOINT_VELOCITY]


@pytest.mark.parametrize("point", range(4))
def test_a_point_under_load_is_felt_and_no_other(robot, sense, point):
    force = np.zeros((4, 3))
    force[point] = [5.0, -5.0, 30.0]
    state, torque = held(robot, force)
    felt = [sense.update(k * PERIOD, state, torque) for k in range(2)]
    assert not felt[0].any()  # nothing to compare with
    np.testing.assert_array_equal(felt[1], np.arange(4) == point)


@pytest.mark.parametrize("share", [0.09, 0.11])
def test_a_share_of_the_weight_decides(robot, sense, share):
    force = np.zeros((4, 3))
    force[:, 2] = share * robot.mass * 9.81
    state, torque = held(robot, force)
    for k in range(2):
        felt = sense.update(k * PERIOD, state, torque)
    assert felt.all() == felt.any() == (share > TouchdownSensing().share_of_weight)


def test_legs_that_accelerate_feel_their_own_inertia_as_none(robot, sense):
    kinematics = Kinematics(robot)
    q, v = robot.standing_configuration(), np.zeros(robot.model.nv)
    vdot = np.zeros(robot.model.nv)
    vdot[JOINT_VELOCITY] = np.tile([0.0, 200.0, -300.0], 4)  # stretching
    before, after = kinematics.at(q, v), kinematics.at(q, v + vdot * PERIOD)
    friction = robot.actuators.friction(after.v[JOINT_VELOCITY], STICTION_SPEED)
    torque = (after.M @ vdot + after.nle)[JOINT_VELOCITY] + friction
    assert not sense.update(0.0, before, torque).any()
    assert not sense.update(PERIOD, after, torque).any()
    assert sense.update(2 * PERIOD, after, torque).any()  # the same torques on legs that push instead


def test_what_was_felt_is_forgotten(robot, sense):
    state, torque = held(robot, np.tile([0.0, 0.0, 30.0], (4, 1)))
    for k in range(2):
        felt = sense.update(k * PERIOD, state, torque)
    assert felt.all()
    sense.forget()
    assert not sense.update(2 * PERIOD, state, torque).any()


@pytest.fixture(scope="module")
def landed_at(robot, hop):
    """When flight ended and when half of the points were down after the planned landing: ``landed_at(mode, rise, seed)``."""

    def landed_at(mode, rise, seed=0):
        told = robot.with_section("controller", touchdown=mode)
        simulation = Simulation(told, seed=seed, conditions=Conditions())
        controller = Controller(told)
        measurement = simulation.measure()
        for _ in range(round(STAND_TIME / PERIOD)):
            measurement = simulation.step(controller.step(measurement))
        controller.accept(hop)
        start, down, landing = measurement.time, None, None
        while landing is None:
            measurement = simulation.step(controller.step(measurement))
            time = measurement.time - start
            if time > hop.take_off_time + 0.05:
                simulation.disturb(ground_rise=rise)
                if down is None and 2 * simulation.ground_truth().contact.sum() >= robot.n_contacts:
                    down = time
            landing = time - PERIOD if controller.phase is Phase.LANDING else None
        return landing - hop.landing_time, None if down is None else down - hop.landing_time

    return landed_at


@pytest.mark.parametrize("rise", [-0.03, 0.0, 0.03])
def test_flight_ends_with_the_contact_however_early_or_late(landed_at, rise):
    landing, down = landed_at("contact", rise)
    assert 0.0 <= landing - down + PERIOD <= DELAY + PERIOD
    assert landing * rise <= 1e-9 or abs(landing) < DELAY


@pytest.mark.parametrize("rise", [-0.03, 0.03])
def test_by_time_flight_ends_as_planned(landed_at, rise):
    landing, _ = landed_at("time", rise)
    assert landing == pytest.approx(0.0, abs=PERIOD)


def test_a_contact_is_not_waited_for_for_ever(landed_at):
    landing, down = landed_at("contact", -1.0)
    assert down is None
    assert landing == pytest.approx(TouchdownSensing().patience, abs=PERIOD)
