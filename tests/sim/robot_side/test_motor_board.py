"""The actuator law as the simulated motors obey it."""

import numpy as np
import pytest

from aerial_model.values.terrain import Terrain
from aerial_sim.robot_side.motor_board import MotorBoards
from aerial_sim.simulation import Simulation

NO_LOAD_SPEED = {"abad": 40.0, "hip": 40.0, "knee": 25.72}  # [rad/s] 24 V over k_e g_r
CORNER_SPEED = {"abad": 28.47, "hip": 28.47, "knee": 18.31}  # [rad/s] up to which the full torque is there
TORQUE_MAX = {"abad": 18.0, "hip": 18.0, "knee": 27.99}  # [N·m]
SPEED_TOLERANCE = 0.05  # [rad/s]


def kind(name):
    return name.split("_")[1]


@pytest.fixture
def boards(robot):
    return MotorBoards(robot.actuators, 1)


@pytest.fixture
def by_joint(robot):
    return lambda table: np.array([table[kind(name)] for name in robot.joint_names])


def test_full_torque_is_delivered_up_to_the_corner_speed(robot, boards, torque_command, by_joint):
    speed = by_joint(CORNER_SPEED) - SPEED_TOLERANCE
    delivered = boards.torque(0, torque_command(100.0), np.zeros(12), speed)
    np.testing.assert_allclose(delivered, by_joint(TORQUE_MAX))


def test_less_than_full_torque_is_delivered_beyond_it(robot, boards, torque_command, by_joint):
    speed = by_joint(CORNER_SPEED) + SPEED_TOLERANCE
    delivered = boards.torque(0, torque_command(100.0), np.zeros(12), speed)
    assert np.all(delivered < by_joint(TORQUE_MAX))


def test_no_torque_is_left_at_the_no_load_speed(robot, boards, torque_command, by_joint):
    below = boards.torque(0, torque_command(100.0), np.zeros(12), by_joint(NO_LOAD_SPEED) - SPEED_TOLERANCE)
    beyond = boards.torque(0, torque_command(100.0), np.zeros(12), by_joint(NO_LOAD_SPEED) + SPEED_TOLERANCE)
    assert np.all(below > 0)
    assert np.all(beyond < 0)


def test_a_leg_in_the_air_never_outruns_its_motors(robot, torque_command):
    """Full torque on one hip in weightlessness: the joint winds up towards, not beyond, the no-load speed."""
    simulation = Simulation(robot, noise="off")
    simulation.model.opt.gravity[:] = 0.0
    simulation.model.jnt_limited[:] = 0
    simulation.model.geom_contype[:] = 0
    hip = robot.joint_names.index("fr_hip")
    torque = np.zeros(12)
    torque[hip] = 100.0
    fastest = 0.0
    for _ in range(200):
        simulation.step(torque_command(torque))
        fastest = max(fastest, abs(simulation.state()[1][6 + hip]))
    assert 0.8 * NO_LOAD_SPEED["hip"] < fastest < NO_LOAD_SPEED["hip"]


def test_the_set_point_loop_is_closed_at_every_physics_step(robot, hold):
    """The mean requested torque of a period is not what its first state alone asked for."""
    simulation = Simulation(robot, terrain=Terrain(), seed=1)
    q, v = simulation.state()
    first = hold.requested_torque(q[7:], v[6:])
    simulation.step(hold)
    assert np.abs(simulation.ground_truth().requested_torque - first).max() > 1e-3


def test_ratios_are_those_of_the_torque_before_any_limit(robot, torque_command, by_joint):
    simulation = Simulation(robot, noise="off")
    simulation.step(torque_command(1.5 * by_joint(TORQUE_MAX)))
    truth = simulation.ground_truth()
    assert truth.peak_torque_ratio == pytest.approx(1.5)
    assert np.all(np.abs(truth.delivered_torque) <= by_joint(TORQUE_MAX))
    assert np.all(np.abs(truth.requested_torque) > by_joint(TORQUE_MAX))


def test_the_peak_of_a_period_is_kept_not_its_mean(robot, torque_command):
    boards = MotorBoards(robot.actuators, 2)
    boards.torque(0, torque_command(9.0), np.zeros(12), np.zeros(12))
    boards.torque(1, torque_command(18.0), np.zeros(12), np.zeros(12))
    assert boards.peak_torque_ratio == pytest.approx(1.0)
    np.testing.assert_allclose(boards.requested_torque, 13.5)


def test_the_voltage_ratio_counts_the_back_emf(robot, boards, torque_command):
    speed = robot.actuators.no_load_speed
    boards.torque(0, torque_command(0.0), np.zeros(12), speed)
    assert boards.peak_voltage_ratio == pytest.approx(1.0)


def test_set_points_pull_with_their_gains(robot, boards, hold):
    delivered = boards.torque(0, hold, robot.poses["home"] - 0.1, np.full(12, 0.5))
    np.testing.assert_allclose(delivered, hold.stiffness * 0.1 - hold.damping * 0.5)


def test_clearing_forgets_the_period(robot, boards, torque_command):
    boards.torque(0, torque_command(5.0), np.zeros(12), np.ones(12))
    boards.clear()
    assert boards.peak_torque_ratio == boards.peak_voltage_ratio == 0.0


def test_dry_friction_holds_a_joint_against_less_than_itself(robot, torque_command):
    simulation = Simulation(robot, noise="off")
    simulation.model.opt.gravity[:] = 0.0
    friction = float(robot.actuators.dry_friction[0])
    knee = robot.joint_names.index("hl_knee")
    torque = np.zeros(12)
    torque[knee] = 0.9 * friction
    for _ in range(100):
        simulation.step(torque_command(torque))
    assert abs(simulation.state()[1][6 + knee]) < 1e-3
