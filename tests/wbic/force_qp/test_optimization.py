"""The force optimization against its own conditions: equations of motion, pyramids, optimality; and its one fallback."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from aerial_model.robot.contact import friction_pyramid
from aerial_model.robot.robot import BASE_TWIST
from aerial_wbic.behaviours.support import shared_load
from aerial_wbic.force_qp import solvers
from aerial_wbic.force_qp.equations import TorqueHeadroom
from aerial_wbic.force_qp.optimization import ForceOptimization
from aerial_wbic.force_qp.solvers import SOLVERS
from aerial_wbic.gains import QpSolver

EQUATION_TOLERANCE = 1e-8  # [N], [N·m]
FORCE_TOLERANCE = 0.1  # that a force may leave the pyramid [N]
GRADIENT_TOLERANCE = 0.03  # of the cost's gradient, relative to its largest part
KKT_TOLERANCE = 1e-6  # of the independent optimum, relative to the cost's gradient
OPTIMUM_TOLERANCE = 0.01  # between the solver's forces and the independent ones, relative to the largest
REST_TOLERANCE = 1e-4  # of accelerations and forces, relative to the largest: directions that are hardly held
HEADROOM_TOLERANCE = 0.5  # by which a torque may leave its headroom [N·m], or a force the pyramid on that account [N]
ACTIVE = 0.3  # slack below which a face of the pyramid is taken to bear [N]

contacts = st.lists(st.booleans(), min_size=4, max_size=4).map(np.array)
any_state = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40, deadline=None)


@pytest.fixture(params=QpSolver)
def optimization(robot, gains, request):
    return ForceOptimization(robot, gains.weight_base, gains.weight_force, SOLVERS[request.param])


def problem(state, seed):
    """An acceleration to command and forces to start from, of the size a jump has."""
    random = np.random.default_rng(seed)
    return 5.0 * random.normal(size=len(state.v)), load(state, np.zeros(3)) + random.normal(0, 5.0, (4, 3))


def load(state, acceleration):
    """Forces that accelerate the centre of mass."""
    force = np.empty((4, 3))
    shared_load(state, acceleration, force)
    return force


def residual(state, solution):
    """Base rows of H q̈ + C q̇ + G − J_cᵀ f."""
    forces = np.einsum("ikv,ik->v", state.J_contacts, solution.force)
    return (state.M @ solution.vdot + state.nle - forces)[BASE_TWIST]


@any_state
@given(seed=st.integers(0, 10**6), contact=contacts)
def test_the_base_obeys_the_equations_of_motion(optimization, state_at, seed, contact):
    state = state_at(seed)
    vdot_cmd, f_cmd = problem(state, seed)
    solution = optimization.solve(state, vdot_cmd, f_cmd, contact)
    np.testing.assert_allclose(residual(state, solution), 0.0, atol=EQUATION_TOLERANCE)


def contact_consistent(state, contact):
    """E of (3.24) from its definition: least kinetic energy of the joints, loaded points at rest, as a system of equations."""
    J = state.J_contacts[contact].reshape(-1, len(state.v))
    n = len(state.v) - 6
    system = np.block([[state.M[6:, 6:], J[:, 6:].T], [J[:, 6:], np.zeros((len(J), len(J)))]])
    right = np.vstack([np.zeros((n, 6)), -J[:, :6]])
    return np.vstack([np.eye(6), np.linalg.lstsq(system, right, rcond=None)[0][:n]])


@any_state
@given(seed=st.integers(0, 10**6), contact=contacts)
def test_joints_accelerate_with_the_base_and_loaded_points_stay(optimization, state_at, seed, contact):
    state = state_at(seed)
    vdot_cmd, f_cmd = problem(state, seed)
    change = optimization.solve(state, vdot_cmd, f_cmd, contact).vdot - vdot_cmd
    size = np.abs(change).max()
    np.testing.assert_allclose(change, contact_consistent(state, contact) @ change[:6], atol=REST_TOLERANCE * size)
    np.testing.assert_allclose(state.J_contacts[contact] @ change, 0.0, atol=REST_TOLERANCE * size)


@pytest.mark.parametrize("seed", range(10))
def test_its_torques_make_the_ground_give_its_forces(optimization, robot, state_at, seed):
    """Forward dynamics with the feet held: nothing that was optimized differs from what then happens."""
    state = state_at(seed)
    contact = np.ones(4, dtype=bool)
    solution = optimization.solve(state, *problem(state, seed), contact)
    J = state.J_contacts.reshape(-1, len(state.v))
    system = np.block([[state.M, -J.T], [J, np.zeros((len(J), len(J)))]])
    right = np.concatenate([np.zeros(6), solution.torque, J @ problem(state, seed)[0]])
    right[: len(state.v)] -= state.nle
    happens = np.linalg.solve(system, right)
    np.testing.assert_allclose(happens[: len(state.v)], solution.vdot, atol=REST_TOLERANCE * np.abs(happens).max())
    np.testing.assert_allclose(
        happens[len(state.v) :], solution.force.ravel(), atol=REST_TOLERANCE * np.abs(happens).max()
    )


@any_state
@given(seed=st.integers(0, 10**6), contact=contacts)
def test_forces_stay_in_the_pyramid_and_out_of_the_air(optimization, robot, state_at, seed, contact):
    state = state_at(seed)
    solution = optimization.solve(state, *problem(state, seed), contact)
    slack = solution.force @ friction_pyramid(robot.friction_coefficient).T
    assert solution.solved
    assert slack.min() > -FORCE_TOLERANCE
    assert not solution.force[~contact].any()


@any_state
@given(seed=st.integers(0, 10**6), contact=contacts.filter(np.any))
def test_no_other_forces_cost_less(optimization, robot, gains, state_at, seed, contact):
    """The gradient of the cost over the forces is a non-negative sum of the faces that bear: KKT of a convex problem."""
    state = state_at(seed)
    vdot_cmd, f_cmd = problem(state, seed)
    solution = optimization.solve(state, vdot_cmd, f_cmd, contact)
    base = (solution.vdot - vdot_cmd)[BASE_TWIST]
    H_E = state.M[BASE_TWIST] @ contact_consistent(state, contact)
    lift = np.linalg.solve(H_E, state.J_contacts[contact, :, BASE_TWIST].reshape(-1, 6).T)
    change = (solution.force - f_cmd)[contact].ravel()
    parts = gains.weight_base * lift.T @ base, gains.weight_force * change
    W = np.kron(np.eye(contact.sum()), friction_pyramid(robot.friction_coefficient))
    bearing = W[W @ solution.force[contact].ravel() < ACTIVE]
    _, left = nnls(bearing.T, sum(parts)) if len(bearing) else (None, np.linalg.norm(sum(parts)))
    assert left < GRADIENT_TOLERANCE * (1 + max(np.abs(part).max() for part in parts))


def condensed(robot, gains, state, vdot_cmd, f_cmd, contact):
    """The program (3.24) in the loaded forces x alone, min ½ xᵀ H x + gᵀ x s.t. W x ≥ 0, from its formulas."""
    H_E = state.M[BASE_TWIST] @ contact_consistent(state, contact)
    lift = np.linalg.solve(H_E, state.J_contacts[contact, :, BASE_TWIST].reshape(-1, 6).T)
    missing = -np.linalg.solve(H_E, (state.M @ vdot_cmd + state.nle)[BASE_TWIST])
    planned = f_cmd[contact].ravel()
    H = gains.weight_base * lift.T @ lift + gains.weight_force * np.eye(len(planned))
    g = gains.weight_base * lift.T @ missing - gains.weight_force * planned
    return H, g, np.kron(np.eye(contact.sum()), friction_pyramid(robot.friction_coefficient))


def by_least_distance(H, g, W):
    """The minimum and the multipliers of its constraints, by Lawson and Hanson's least distance programming."""
    L = np.linalg.cholesky(H)
    A, b = np.linalg.solve(L, W.T).T, W @ np.linalg.solve(H, g)  # z = Lᵀ x + L⁻¹ g:  min ‖z‖  s.t.  A z ≥ b
    scale = max(1.0, np.abs(b).max())
    u, _ = nnls(np.vstack([A.T, b / scale]), np.append(np.zeros(len(H)), 1.0))
    left = 1.0 - b @ u / scale
    z, multipliers = scale * A.T @ u / left, scale * u / left
    return np.linalg.solve(L.T, z - np.linalg.solve(L, g)), multipliers


@any_state
@given(seed=st.integers(0, 10**6), contact=contacts.filter(np.any))
def test_the_optimum_is_that_of_another_method_and_meets_the_kkt_conditions(
    optimization, robot, gains, state_at, seed, contact
):
    state = state_at(seed)
    vdot_cmd, f_cmd = problem(state, seed)
    H, g, W = condensed(robot, gains, state, vdot_cmd, f_cmd, contact)
    best, multipliers = by_least_distance(H, g, W)
    size = 1 + np.abs(H @ best).max()
    np.testing.assert_allclose(H @ best + g, W.T @ multipliers, atol=KKT_TOLERANCE * size)  # stationary
    assert (W @ best).min() > -KKT_TOLERANCE * size  # primal feasible
    assert multipliers.min() >= 0.0  # dual feasible
    np.testing.assert_allclose(
        multipliers * (W @ best), 0.0, atol=KKT_TOLERANCE * size * (1 + multipliers.max())
    )  # complementary
    found = optimization.solve(state, vdot_cmd, f_cmd, contact).force[contact].ravel()
    np.testing.assert_allclose(found, best, atol=OPTIMUM_TOLERANCE * (1 + np.abs(best).max()))


@pytest.mark.parametrize("seed", range(5))
def test_in_flight_the_base_falls_as_it_must(optimization, robot, state_at, seed):
    state = state_at(seed)
    solution = optimization.solve(state, problem(state, seed)[0], np.zeros((4, 3)), np.zeros(4, dtype=bool))
    torque = state.M[6:] @ solution.vdot + state.nle[6:]
    expected = pin.aba(robot.model, robot.model.createData(), state.q, state.v, np.concatenate([np.zeros(6), torque]))
    np.testing.assert_allclose(solution.vdot, expected, atol=1e-6)


def test_commanded_forces_that_fit_are_taken(optimization, state_at):
    state = state_at(moving=False)
    weight = load(state, np.zeros(3))
    solution = optimization.solve(state, np.zeros(len(state.v)), weight, np.ones(4, dtype=bool))
    np.testing.assert_allclose(solution.force, weight, atol=0.05)


@pytest.mark.parametrize("solver", QpSolver)
def test_equal_input_gives_equal_output(robot, gains, state_at, solver):
    def run() -> list[np.ndarray]:
        optimization = ForceOptimization(robot, gains.weight_base, gains.weight_force, SOLVERS[solver])
        states = [(state_at(seed), seed) for seed in range(5)]
        contact = np.ones(4, dtype=bool)
        return [optimization.solve(state, *problem(state, seed), contact).force.copy() for state, seed in states]

    for first, second in zip(run(), run(), strict=True):
        np.testing.assert_array_equal(first, second)


def test_a_failed_solve_falls_back_and_the_next_one_works(optimization, state_at):
    state = state_at(1)
    vdot_cmd, f_cmd = problem(state, 1)
    contact = np.ones(4, dtype=bool)
    good = optimization.solve(state, vdot_cmd, f_cmd, contact).force.copy()
    assert not optimization.solve(state, vdot_cmd * np.nan, f_cmd, contact).solved
    again = optimization.solve(state, vdot_cmd, f_cmd, contact)
    assert again.solved
    np.testing.assert_allclose(again.force, good, atol=0.1)


def test_a_state_that_is_no_number_raises_nothing(optimization, state_at):
    """The joint_commands then only damps."""
    state = state_at(1)
    desired = problem(state, 1)
    state.M[:] = np.nan
    solution = optimization.solve(state, *desired, np.ones(4, dtype=bool))
    assert not np.isfinite(solution.torque).any()


@pytest.mark.parametrize("name", ["Osqp", "Daqp"])
def test_the_fallback_keeps_the_pyramid_and_the_equations_of_motion(robot, gains, state_at, monkeypatch, name):
    monkeypatch.setattr(f"aerial_wbic.force_qp.solvers.{name}.minimum", lambda *_: None)
    optimization = ForceOptimization(robot, gains.weight_base, gains.weight_force, getattr(solvers, name))
    state = state_at(2)
    vdot_cmd, f_cmd = problem(state, 2)
    solution = optimization.solve(state, vdot_cmd, f_cmd, np.ones(4, dtype=bool))
    assert not solution.solved
    assert (solution.force @ friction_pyramid(robot.friction_coefficient).T).min() > -FORCE_TOLERANCE
    np.testing.assert_allclose(residual(state, solution), 0.0, atol=EQUATION_TOLERANCE)


def landing(state):
    """An upward acceleration of the base that asks for half as much again as the knees can give."""
    vdot_cmd = np.zeros(len(state.v))
    vdot_cmd[2] = 40.0
    return vdot_cmd, load(state, np.array([0.0, 0.0, 40.0]))


def headroom_of(state, torque):
    return TorqueHeadroom(np.full(len(state.v) - 6, -torque), np.full(len(state.v) - 6, torque))


@any_state
@given(seed=st.integers(0, 10**6), contact=contacts.filter(np.any))
def test_torques_stay_within_their_headroom(optimization, robot, state_at, seed, contact):
    state = state_at(seed)
    desired = *landing(state), contact
    without = optimization.solve(state, desired[0], 0 * desired[1], np.zeros(4, dtype=bool)).torque.copy()
    plain = optimization.solve(state, *desired)
    headroom = headroom_of(state, 12.0)
    limited = optimization.within(headroom, plain, state, *desired)
    torque, bearing = limited.torque, np.repeat(contact, 3)
    assert np.all(torque[bearing] < np.maximum(headroom.greatest, without)[bearing] + HEADROOM_TOLERANCE)
    assert np.all(torque[bearing] > np.minimum(headroom.least, without)[bearing] - HEADROOM_TOLERANCE)
    assert (limited.force @ friction_pyramid(robot.friction_coefficient).T).min() > -HEADROOM_TOLERANCE
    np.testing.assert_allclose(residual(state, limited), 0.0, atol=EQUATION_TOLERANCE)


def test_with_too_little_headroom_the_robot_brakes_as_hard_as_it_can(optimization, state_at):
    state = state_at(moving=False)
    contact = np.ones(4, dtype=bool)
    plain = optimization.solve(state, *landing(state), contact)
    assert np.abs(plain.torque).max() > 15.0
    limited = optimization.within(headroom_of(state, 15.0), plain, state, *landing(state), contact)
    assert np.abs(limited.torque).max() == pytest.approx(15.0, abs=HEADROOM_TOLERANCE)
    assert limited.force[:, 2].sum() < plain.force[:, 2].sum()


def test_with_enough_headroom_nothing_changes(optimization, state_at):
    state = state_at(moving=False)
    contact = np.ones(4, dtype=bool)
    plain = optimization.solve(state, *landing(state), contact)
    limited = optimization.within(headroom_of(state, 50.0), plain, state, *landing(state), contact)
    np.testing.assert_allclose(limited.force, plain.force, atol=FORCE_TOLERANCE)
