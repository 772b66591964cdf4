"""Steps of the knots against the robot itself: Pinocchio's kinematics, and differences along the manifold."""

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from aerial_model.numerics import rotation
from aerial_model.robot.robot import BASE_ANGULAR, GRAVITY, JOINT_POSITION, JOINT_VELOCITY
from aerial_planner.formulation.kino_dynamic_layouts import KinoDynamicLayouts
from aerial_planner.formulation.knots import FlightInterval, LiftOffKnot, TakeOffKnot, holding_joints, world_feet
from aerial_planner.formulation.vector_layout import StageSymbols
from aerial_planner.kinematics import base_frame_model

DT = 0.02  # [s]
STEP = 1e-6  # of differences [s]
TOLERANCE = 1e-9
DIFFERENCE_TOLERANCE = 1e-4  # SI units
LOADED = (True, False, False, True)


@pytest.fixture(scope="module")
def model(robot):
    return base_frame_model(robot)


@pytest.fixture(scope="module")
def layouts(robot):
    return KinoDynamicLayouts.of(robot, n_limited=0, timed=False)


def some(layout, rng):
    """Numbers for all entries of a layout; quaternions of length 1."""
    values = {name: rng.normal(size=shape) for name, shape in layout.entries.items()}
    return {n: v / np.linalg.norm(v) if n.startswith("quaternion") else v for n, v in values.items()}


def at(expressions, s, x, u, p):
    """Values of expressions of a knot."""
    layout = s.layout
    vectors = layout.state.pack(**x), layout.control.pack(**u), layout.parameters.pack(**p)
    return [np.asarray(value) for value in ca.Function("at", [s.x, s.u, s.p], expressions).call(list(vectors))]


@pytest.fixture
def take_off(layouts):
    rng = np.random.default_rng(1)
    layout = layouts.take_off(n_loaded=sum(LOADED))
    x, u, p = (some(part, rng) for part in (layout.state, layout.control, layout.parameters))
    return TakeOffKnot(layout, LOADED), x, u, p | {"dt": DT}


def test_a_step_of_the_body_is_the_integral_of_its_forces(robot, take_off):
    s, x, u, p = take_off
    following = s.layout.state.unpack(at([s.step(robot.mass)], s, x, u, p)[0].ravel())
    acceleration = u["f"].sum(axis=1) / robot.mass - [0.0, 0.0, GRAVITY]
    np.testing.assert_allclose(following["rdot"], x["rdot"] + DT * acceleration, atol=TOLERANCE)
    np.testing.assert_allclose(following["r"], x["r"] + DT * x["rdot"] + 0.5 * DT**2 * acceleration, atol=TOLERANCE)
    time = DT * (np.arange(2000) + 0.5) / 2000
    com = x["r"] + np.outer(time, x["rdot"]) + 0.5 * np.outer(time**2, acceleration)
    feet = p["foot_ref"].T[np.array(LOADED)]
    moment = sum(np.cross(foot - com, f).mean(axis=0) for foot, f in zip(feet, u["f"].T, strict=True))
    np.testing.assert_allclose(following["alpha"], x["alpha"] + DT * moment, atol=1e-8)


def test_a_step_of_the_pose_is_pinocchios(robot, take_off):
    s, x, u, p = take_off
    following = s.layout.state.unpack(at([s.step(robot.mass)], s, x, u, p)[0].ravel())
    q = np.concatenate([np.zeros(3), x["quaternion"], x["q_j"]])
    v = np.concatenate([np.zeros(3), u["omega"], u["dq_j"]])
    integrated = pin.integrate(robot.model, q, DT * v)
    np.testing.assert_allclose(following["q_j"], integrated[JOINT_POSITION], atol=TOLERANCE)
    np.testing.assert_allclose(following["quaternion"], integrated[3:7], atol=TOLERANCE)
    np.testing.assert_array_equal(following["dq_before"], u["dq_j"])


def test_feet_are_where_the_centre_of_mass_and_the_attitude_put_them(robot, model, take_off):
    s, x, u, p = take_off
    feet = at([world_feet(model, s)], s, x, u, p)[0].T
    q = np.concatenate([np.zeros(3), x["quaternion"], x["q_j"]])
    com = pin.centerOfMass(robot.model, robot.model.createData(), q)
    np.testing.assert_allclose(feet, robot.contact_positions(q) + x["r"] - com, atol=TOLERANCE)


def test_foot_velocities_are_differences_along_the_motion(robot, model, layouts):
    rng = np.random.default_rng(2)
    s = LiftOffKnot(layouts.lift_off)
    x, u, p = (some(part, rng) for part in (s.layout.state, s.layout.control, s.layout.parameters))
    found = np.hstack(at(s.foot_velocities(model), s, x, u, p)).T  # in B

    def feet(time):
        v = np.concatenate([np.zeros(3), u["omega_ground"], x["dq_before"]])
        q = pin.integrate(robot.model, np.concatenate([np.zeros(3), x["quaternion"], x["q_j"]]), time * v)
        com = pin.centerOfMass(robot.model, robot.model.createData(), q)
        return robot.contact_positions(q) - com + x["r"] + time * x["rdot"]

    difference = (feet(STEP) - feet(-STEP)) / (2 * STEP)
    np.testing.assert_allclose(found, difference @ rotation.matrix(x["quaternion"]), atol=DIFFERENCE_TOLERANCE)


def test_in_flight_the_body_turns_so_that_momentum_is_kept(robot, model, layouts):
    rng = np.random.default_rng(3)
    s = StageSymbols(layouts.flight)
    flight = FlightInterval(robot, s, s.arm_rate_before)
    x, u, p = (some(part, rng) for part in (s.layout.state, s.layout.control, s.layout.parameters))
    x, p = x | {"T": 0.4}, p | {"share": 0.05, "fraction": 0.1}
    gap, following = at([flight.momentum_gap(model), flight.step(layouts.flight)], s, x, u, p)
    after = s.layout.state.unpack(following.ravel())
    q, q_next = (np.concatenate([np.zeros(3), state["quaternion"], state["q_j"]]) for state in (x, after))
    v = pin.difference(robot.model, q, q_next) / DT
    middle = pin.interpolate(robot.model, q, q_next, 0.5)
    v[BASE_ANGULAR] = u["omega"]
    h = pin.computeCentroidalMomentum(robot.model, robot.model.createData(), middle, v)
    in_base = rotation.matrix(middle[3:7]).T @ (x["alpha"] - h.angular)
    np.testing.assert_allclose(gap.ravel(), in_base, atol=1e-8)
    np.testing.assert_allclose(v[JOINT_VELOCITY], 0.1 * (p["pose_ahead"] - x["q_j"]) / DT, atol=1e-8)


def test_the_joints_that_hold_a_contact_are_those_of_its_leg(robot, model):
    holding = holding_joints(model, LOADED)
    J = np.asarray(ca.DM(model.foot_jacobians(robot.poses["home"] + 0.1)).full()).reshape(4, 3, -1)
    np.testing.assert_array_equal(holding, np.abs(J[np.array(LOADED)]).max(axis=(0, 1)) > 1e-6)
