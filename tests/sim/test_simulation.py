import dataclasses

import numpy as np
import pytest

from aerial_model.errors import ConfigurationError
from aerial_model.kinematics import Kinematics
from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ORIENTATION, JOINT_POSITION
from aerial_model.values.frame import StartFrame
from aerial_model.values.measurement import Measurement
from aerial_model.values.terrain import Box, Terrain
from aerial_sim.conditions import PHYSICS_STEP, Conditions
from aerial_sim.simulation import Simulation

GRAVITY = 9.81  # [m/s²]
STAND_TIME = 1.0  # [s] long enough to settle
SINKING = 1e-4  # [m] of a standing foot into the ground
CREEP = 1e-4  # [m] of a standing foot in STAND_TIME
PLATFORM = Terrain(boxes=(Box(centre=[0.0, 0.0, 0.1], size=[0.9, 0.9, 0.2]),))


def advance(simulation, command, duration):
    for _ in range(round(duration / simulation.control_dt)):
        simulation.step(command)
    return simulation.ground_truth()


def lowest_point(robot, q):
    return min(robot.contact_positions(q)[:, 2] - [point.radius for point in robot.contact_points])


def lifted(simulation, height):
    q, v = simulation.state()
    q[2] += height
    simulation.set_state(q, v)


def fields_equal(a: Measurement, b: Measurement) -> bool:
    names = [field.name for field in dataclasses.fields(Measurement) if field.name != "localization"]
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)


def test_reset_starts_at_home_with_the_lowest_foot_on_the_ground(robot):
    q, v = Simulation(robot, noise="off").state()
    np.testing.assert_allclose(q, robot.standing_configuration(), atol=1e-12)
    np.testing.assert_array_equal(v, 0.0)


@pytest.mark.parametrize("seed", range(5))
def test_a_seed_offsets_joints_by_a_degree_at_most_and_turns_the_robot(robot, seed):
    q, _ = Simulation(robot, seed=seed).state()
    offset = np.abs(q[JOINT_POSITION] - robot.poses["home"])
    assert 0 < offset.max() <= np.radians(1.0)
    assert rotation.heading(q[BASE_ORIENTATION]) != 0.0
    assert lowest_point(robot, q) == pytest.approx(0.0, abs=1e-12)


def test_reset_on_a_box_starts_on_top_of_it(robot):
    q, _ = Simulation(robot, terrain=PLATFORM, seed=1).state()
    assert lowest_point(robot, q) == pytest.approx(0.2, abs=1e-12)


def test_free_fall_is_uniform_acceleration_of_the_centre_of_mass(robot, torque_command):
    simulation = Simulation(robot, noise="off")
    lifted(simulation, 1.0)
    height = Kinematics(robot).at(*simulation.state()).com[2]
    truth = advance(simulation, torque_command(0.0), 0.3)
    fallen = height - Kinematics(robot).at(truth.q, truth.v).com[2]
    one_step = GRAVITY * 0.3 * PHYSICS_STEP  # [m] a first-order integrator's error
    assert fallen == pytest.approx(GRAVITY * 0.3**2 / 2, abs=one_step)
    assert not truth.contact.any()


def test_an_accelerometer_in_free_fall_reads_nothing_and_at_rest_gravity(robot, torque_command, hold):
    simulation = Simulation(robot, noise="off")
    at_rest = advance_and_measure(simulation, hold, STAND_TIME)
    lifted(simulation, 1.0)
    simulation.step(torque_command(0.0))
    # The held joints let go in the first period; from the second on nothing moves within the robot but slowly.
    falling = advance_and_measure(simulation, torque_command(0.0), 0.1)
    np.testing.assert_allclose(at_rest.linear_acceleration, [0, 0, GRAVITY], atol=0.1)
    assert np.linalg.norm(falling.linear_acceleration) < 1.0


def advance_and_measure(simulation, command, duration):
    advance(simulation, command, duration)
    return simulation.measure()


def test_the_accelerometer_integrates_to_the_change_of_velocity(robot, hold):
    simulation = Simulation(robot, noise="off")
    lifted(simulation, 0.1)  # it lands with an impact
    velocity = np.zeros(3)
    for _ in range(200):
        measurement = simulation.step(hold)
        R_WB = rotation.matrix(measurement.orientation)
        velocity += (R_WB @ measurement.linear_acceleration - [0, 0, GRAVITY]) * simulation.control_dt
    q, v = simulation.state()
    np.testing.assert_allclose(velocity, rotation.matrix(q[BASE_ORIENTATION]) @ v[:3], atol=1e-9)


def test_flight_keeps_angular_momentum(robot, hold):
    simulation = Simulation(robot, noise="off")
    q, v = simulation.state()
    q[2] = 3.0
    v[3:6] = [0.5, 8.0, 1.0]
    simulation.set_state(q, v)
    before = Kinematics(robot).at(q, v).angular_momentum
    swing = np.tile([0.2, 0.5, 0.6], 4)  # [rad]
    for _ in range(250):
        pose = robot.poses["home"] + swing * np.sin(6 * np.pi * simulation.time)
        simulation.step(dataclasses.replace(hold, position=pose, stiffness=hold.stiffness * 0.6))
    after = Kinematics(robot).at(*simulation.state()).angular_momentum
    assert np.linalg.norm(after - before) < 0.003 * np.linalg.norm(before)


@pytest.mark.parametrize("terrain", [Terrain(), PLATFORM], ids=["floor", "box"])
def test_it_stands_without_sinking_or_creeping(robot, hold, terrain):
    simulation = Simulation(robot, terrain=terrain, noise="off")
    settled = advance(simulation, hold, STAND_TIME)
    later = advance(simulation, hold, STAND_TIME)
    height = terrain.height(np.zeros(2))
    assert later.contact.all()
    assert later.other_contacts == ()
    assert lowest_point(robot, later.q) == pytest.approx(height, abs=SINKING)
    moved = robot.contact_positions(later.q) - robot.contact_positions(settled.q)
    assert np.abs(moved).max() < CREEP


def test_contact_forces_carry_the_weight(robot, hold):
    truth = advance(Simulation(robot, noise="off"), hold, STAND_TIME)
    np.testing.assert_allclose(truth.force.sum(axis=0), [0, 0, robot.mass * GRAVITY], atol=0.01)


def test_a_robot_that_collapses_is_seen_to_lie_on_its_trunk(robot, torque_command):
    truth = advance(Simulation(robot, noise="off"), torque_command(0.0), 2.0)
    assert truth.trunk_contact
    assert truth.other_contacts == ("base",)


def test_a_foot_on_the_ground_is_no_other_contact(robot, hold):
    truth = advance(Simulation(robot, noise="off"), hold, STAND_TIME)
    assert truth.other_contacts == ()
    assert not truth.trunk_contact


def test_robot_parts_that_touch_each_other_do_not_touch_the_world(robot, torque_command):
    simulation = Simulation(robot, noise="off")
    q, v = simulation.state()
    q[2] = 2.0
    q[7 + robot.joint_names.index("fl_abad")] = -1.4
    q[7 + robot.joint_names.index("fr_abad")] = 1.4
    simulation.set_state(q, v)
    truth = advance(simulation, torque_command(0.0), 0.02)
    assert truth.other_contacts == ()
    assert not truth.contact.any()


@pytest.mark.parametrize("noise", ["nominal", "off"])
def test_equal_seeds_and_commands_agree_to_the_last_bit(robot, hold, noise):
    first, second = Simulation(robot, seed=4, noise=noise), Simulation(robot, seed=4, noise=noise)
    assert all(fields_equal(first.step(hold), second.step(hold)) for _ in range(300))


ALL_OPTIONS = {"encoder_counts": 16384, "gear_backlash": 0.005, "localization_rate": 100, "localization_noise": 0.01}


def test_optional_sensors_are_repeatable_to_the_last_bit(robot, hold):
    equipped = robot.with_section("sensors", **ALL_OPTIONS)
    runs = []
    for _ in range(2):
        simulation = Simulation(equipped, seed=4)
        runs.append([simulation.measure(), *(simulation.step(hold) for _ in range(20))])
    assert all(fields_equal(one, other) for one, other in zip(*runs, strict=True))
    assert [reading.localization is not None for reading in runs[0]] == [k % 5 == 0 for k in range(21)]


def test_localization_counts_from_where_the_robot_started(robot, hold):
    equipped = robot.with_section("sensors", localization_rate=500, localization_noise=0.0)
    simulation = Simulation(equipped, terrain=PLATFORM, seed=1)
    q, _ = simulation.state()
    origin = StartFrame.of(robot, q).origin
    np.testing.assert_allclose(simulation.measure().localization, q[:3] - origin, atol=1e-12)


def test_reset_forgets_everything(robot, hold, torque_command):
    fresh, used = Simulation(robot, seed=7), Simulation(robot, seed=6)
    used.disturb([30.0, 0.0, 0.0], 10.0, added_mass=2.0, friction_coefficient=0.1)
    advance(used, torque_command(1.0), 0.5)
    assert fields_equal(fresh.measure(), used.reset(7))
    assert all(fields_equal(fresh.step(hold), used.step(hold)) for _ in range(100))


def test_different_seeds_differ(robot):
    assert not fields_equal(Simulation(robot, seed=0).measure(), Simulation(robot, seed=1).measure())


def test_measuring_twice_gives_the_same_packet(robot):
    simulation = Simulation(robot)
    assert simulation.measure() is simulation.measure()


def test_packets_are_numbered_and_stamped_without_drift(robot, hold):
    simulation = Simulation(robot)
    packets = [simulation.step(hold) for _ in range(700)]
    assert [packet.sequence for packet in packets] == list(range(1, 701))
    assert packets[-1].time == 700 * simulation.control_dt


def test_new_terrain_leaves_the_robot_as_it_is(robot, hold):
    simulation = Simulation(robot, seed=2)
    truth = advance(simulation, hold, STAND_TIME)
    ahead = Terrain(boxes=(Box(centre=[1.0, 0.0, 0.1], size=[0.9, 0.9, 0.2]),))
    simulation.set_terrain(ahead)
    q, v = simulation.state()
    np.testing.assert_array_equal(q, truth.q)
    np.testing.assert_array_equal(v, truth.v)
    assert simulation.ground_truth().contact.all()
    assert simulation.time == truth.time
    assert simulation.terrain is ahead
    later = advance(simulation, hold, STAND_TIME)
    np.testing.assert_allclose(later.q, truth.q, atol=1e-3)


@pytest.mark.parametrize(
    ("terrain", "words"),
    [
        (Terrain(boxes=(Box(centre=[0.0, 0.0, 0.2], size=[0.1, 0.1, 0.4]),)), "run through the robot"),
        (Terrain(boxes=(Box(centre=[0.45, 0.0, 0.08], size=[0.9, 0.9, 0.16]),)), "rise by 0.160 m"),
        (Terrain(base=-0.1), "sink by 0.100 m"),
    ],
)
def test_terrain_in_the_robots_place_is_refused_and_nothing_changes(robot, hold, terrain, words):
    simulation, undisturbed = Simulation(robot, noise="off"), Simulation(robot, noise="off")
    with pytest.raises(ConfigurationError, match=words):
        simulation.set_terrain(terrain)
    assert simulation.terrain == Terrain()
    assert all(fields_equal(simulation.step(hold), undisturbed.step(hold)) for _ in range(50))


def test_a_robot_does_not_start_inside_the_terrain(robot):
    through_the_trunk = Terrain(boxes=(Box(centre=[0.0, 0.0, 0.2], size=[0.1, 0.1, 0.4]),))
    with pytest.raises(ConfigurationError, match=r"where it starts \(base\)"):
        Simulation(robot, terrain=through_the_trunk, noise="off")


def test_a_push_moves_the_trunk_as_long_as_it_lasts(robot, torque_command):
    simulation = Simulation(robot, noise="off")
    lifted(simulation, 2.0)
    simulation.disturb([20.0, 0.0, 0.0], 0.1)
    truth = advance(simulation, torque_command(0.0), 0.3)
    velocity = Kinematics(robot).at(truth.q, truth.v).com_velocity
    assert velocity[0] == pytest.approx(20.0 * 0.1 / robot.mass, rel=1e-6)


def test_added_mass_weighs_and_survives_new_terrain(robot, hold):
    simulation = Simulation(robot, noise="off")
    simulation.disturb(added_mass=1.0)
    simulation.set_terrain(PLATFORM.placed(StartFrame(origin=np.array([2.0, 0.0, 0.0]))))
    truth = advance(simulation, hold, STAND_TIME)
    assert truth.force[:, 2].sum() == pytest.approx((robot.mass + 1.0) * GRAVITY, abs=0.01)


def test_a_trunk_without_mass_is_refused_and_nothing_changes(robot, hold):
    simulation = Simulation(robot, noise="off")
    with pytest.raises(ConfigurationError, match="leave nothing of the trunk"):
        simulation.disturb(added_mass=-10.0, friction_coefficient=0.0)
    assert advance(simulation, hold, STAND_TIME).force[:, 2].sum() == pytest.approx(robot.mass * GRAVITY, rel=0.01)


def test_on_ice_feet_slide(robot, hold):
    simulation = Simulation(robot, noise="off")
    advance(simulation, hold, STAND_TIME)
    simulation.disturb([10.0, 0.0, 0.0], 0.5, friction_coefficient=0.05)
    q_0 = simulation.state()[0]
    truth = advance(simulation, hold, 0.5)
    assert truth.q[0] - q_0[0] > 0.01


def test_a_command_that_is_no_number_is_an_error_not_an_explosion(robot, torque_command):
    simulation = Simulation(robot)
    with pytest.raises(ValueError, match="finite"):
        simulation.step(torque_command(np.nan))


def test_an_unknown_noise_is_refused(robot):
    with pytest.raises(ConfigurationError, match="'nominal' or 'off'"):
        Simulation(robot, noise="loud")


def test_periods_that_do_not_fit_are_refused(robot):
    with pytest.raises(ConfigurationError, match="multiple"):
        Simulation(robot, conditions=Conditions(physics_step=0.0007))
