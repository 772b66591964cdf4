"""The constrained Riccati recursion against the optimality conditions of the whole problem."""

import numpy as np
import pytest

from aerial_planner.ocp.riccati import LinearQuadratic


def problem(seed, *, nx=(4, 5, 3, 4), nu=(3, 2, 3, 0), nc=(4, 3, 1, 2)):
    """Return a convex problem with random numbers."""
    rng = np.random.default_rng(seed)
    steps = [rng.normal(size=(n, x + u)) for n, x, u in zip((*nx[1:], 0), nx, nu, strict=True)]
    for F in steps:
        F[rng.random(F.shape) < 0.3] = 0.0
    links = [np.argwhere(F) for F in steps]
    lq = LinearQuadratic(np.array(nx), np.array(nu), np.array(nc), links)
    for k, (x, u, c) in enumerate(zip(nx, nu, nc, strict=True)):
        y = x + u
        root = rng.normal(size=(y, y))
        lq.coefficients.Q[k, :y, :y], lq.coefficients.q[k, :y] = root @ root.T, rng.normal(size=y)
        lq.coefficients.C[k, :c, :y], lq.coefficients.c[k, :c] = rng.normal(size=(c, y)), rng.normal(size=c)
        if k < len(nx) - 1:
            following = nx[k + 1]
            lq.coefficients.F[k, : len(links[k])], lq.coefficients.f[k, :following] = (
                steps[k][tuple(links[k].T)],
                rng.normal(size=following),
            )
    return lq


def step(lq, k):
    """Return F of a stage."""
    F, links = (
        np.zeros((lq.sizes.nx[k + 1], lq.sizes.nx[k] + lq.sizes.nu[k])),
        lq.coefficients.links[k, : lq.sizes.n_links[k]],
    )
    F[tuple(links.T)] = lq.coefficients.F[k, : len(links)]
    return F


def residuals(lq):
    """Return the gradient of the Lagrangian and the misses of all constraints at the solution."""
    y = [lq.optimum.y[k, : x + u] for k, (x, u) in enumerate(zip(lq.sizes.nx, lq.sizes.nu, strict=True))]
    gradients, misses = [], []
    for k, y_k in enumerate(y):
        n, c, u = len(y_k), lq.sizes.nc[k], lq.sizes.nu[k]
        C = lq.coefficients.C[k, :c, :n]
        gradient = lq.coefficients.Q[k, :n, :n] @ y_k + lq.coefficients.q[k, :n] + C.T @ lq.optimum.constraints[k, :c]
        misses.append(C @ y_k + lq.coefficients.c[k, :c])
        if k > 0:
            gradient[u:] += lq.optimum.dynamics[k - 1, : lq.sizes.nx[k]]
        if k < len(y) - 1:
            x = lq.sizes.nx[k + 1]
            gradient -= step(lq, k).T @ lq.optimum.dynamics[k, :x]
            misses.append(y[k + 1][lq.sizes.nu[k + 1] :] - step(lq, k) @ y_k - lq.coefficients.f[k, :x])
        gradients.append(gradient)
    return np.concatenate(gradients), np.concatenate(misses)


@pytest.mark.parametrize("seed", range(5))
def test_solution_and_multipliers_meet_the_optimality_conditions(seed):
    lq = problem(seed)
    assert lq.solve()
    for residual in residuals(lq):
        np.testing.assert_allclose(residual, 0.0, atol=1e-7)


def test_constraints_on_states_alone_are_met_by_the_stage_before():
    lq = problem(1)
    lq.coefficients.C[1, :3, :2] = 0.0  # the second stage's three rows contain none of its controls
    assert lq.solve()
    for residual in residuals(lq):
        np.testing.assert_allclose(residual, 0.0, atol=1e-7)


def test_a_redundant_constraint_changes_nothing():
    once = problem(2, nc=(1, 3, 1, 2))
    twice = problem(2, nc=(1, 3, 1, 2))
    twice.coefficients.C[1, 2], twice.coefficients.c[1, 2] = (
        2.0 * twice.coefficients.C[1, 1],
        2.0 * twice.coefficients.c[1, 1],
    )
    once.sizes.nc[1] = 2
    assert once.solve()
    assert twice.solve()
    np.testing.assert_allclose(twice.optimum.y, once.optimum.y, atol=1e-9)
    np.testing.assert_allclose(residuals(twice)[0], 0.0, atol=1e-8)


def test_a_given_first_state_is_where_the_solution_starts():
    lq = problem(3, nc=(4, 0, 0, 0))
    lq.coefficients.C[0, :4, :7], lq.coefficients.c[0, :4] = np.eye(4, 7, 3), -np.arange(4)
    assert lq.solve()
    np.testing.assert_allclose(lq.optimum.y[0, 3:7], np.arange(4), atol=1e-10)


def test_curvature_that_is_negative_only_where_constraints_forbid_it_does_not_matter():
    lq = problem(4, nx=(2, 2), nu=(1, 0), nc=(0, 1))
    lq.coefficients.Q[1, :2, :2] = np.diag([-0.1, 1.0])
    lq.coefficients.C[1, 0, :2], lq.coefficients.c[1, 0] = [1.0, 0.0], -0.3
    assert lq.solve()
    np.testing.assert_allclose(residuals(lq)[0], 0.0, atol=1e-9)


def test_without_a_minimum_it_says_so_and_more_curvature_makes_one():
    lq = problem(5, nc=(0, 0, 0, 0))
    lq.coefficients.Q[0, 0, 0] -= 50.0
    assert not lq.solve()
    lq.add_to_diagonal(100.0)
    assert lq.solve()
    np.testing.assert_allclose(residuals(lq)[0], 0.0, atol=1e-8)


def test_rows_of_states_that_pile_up_from_stage_to_stage_are_refused_and_not_written_beyond_the_memory():
    """Nothing controls these states, so that all rows of every stage become rows of the one before."""
    K = 8
    links = [np.array([[0, 0], [1, 1]])] * (K - 1) + [np.zeros((0, 2), dtype=int)]
    lq = LinearQuadratic(np.full(K, 2), np.zeros(K, dtype=int), np.full(K, 2), links)
    lq.coefficients.Q[:], lq.coefficients.C[:] = np.eye(2), np.eye(2)
    lq.coefficients.F[:] = 1.0
    assert not lq.solve()
