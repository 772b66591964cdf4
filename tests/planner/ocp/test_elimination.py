"""Gauss–Jordan elimination against NumPy's rank and products, minimization against solved normal equations."""

import numpy as np
import pytest

from aerial_planner.ocp import elimination


def rows(seed, m, n, rank):
    """Return a matrix ``(m, n)`` of a given rank."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(m, rank)) @ rng.normal(size=(rank, n))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("m", "n", "rank"), [(4, 6, 4), (6, 4, 4), (5, 5, 3), (3, 4, 0), (0, 3, 0), (3, 0, 0)])
def test_reduced_rows_are_the_identity_and_what_the_others_contribute(seed, m, n, rank):
    U = rows(seed, m, n, rank)
    reduced, T, order = U.copy(), np.eye(m), np.arange(n)
    assert elimination.reduce_rows(reduced, T, order) == rank
    np.testing.assert_allclose((T @ U)[:, order], reduced, atol=1e-9)
    np.testing.assert_allclose(reduced[:rank, :rank], np.eye(rank), atol=1e-9)
    np.testing.assert_allclose(reduced[rank:], 0.0, atol=1e-9)
    assert sorted(order) == list(range(n))


def test_rows_of_zeros_are_moved_to_the_end():
    U = rows(1, 5, 4, 3)
    U[[0, 2]] = 0.0
    reduced, T, order = U.copy(), np.eye(5), np.arange(4)
    rank = elimination.reduce_rows(reduced, T, order)
    assert rank == np.linalg.matrix_rank(U)
    np.testing.assert_allclose((T @ U)[:, order], reduced, atol=1e-9)


def symmetric(seed, n):
    root = np.random.default_rng(seed).normal(size=(n, n))
    return root @ root.T


@pytest.mark.parametrize("seed", range(3))
def test_substituted_variables_leave_the_same_cost(seed):
    rng = np.random.default_rng(seed)
    M, N, Y = symmetric(seed, 7), rng.normal(size=(3, 4)), np.empty((3, 4))
    others = rng.normal(size=4)
    both = np.concatenate([-N @ others, others])
    cost, slope = both @ M @ both, (M @ both)[:3]
    elimination.substitute(M, N, Y)
    left = np.triu(M[3:, 3:]) + np.triu(M[3:, 3:], 1).T
    assert others @ left @ others == pytest.approx(cost, rel=1e-12)
    np.testing.assert_allclose(Y @ others, slope, atol=1e-12)


def test_minimized_variables_are_where_the_gradient_vanishes():
    M, gains = symmetric(4, 6), np.empty((2, 3))
    cost, bounded = elimination.minimize(M, 1, 2, gains)
    assert bounded
    others = np.array([0.3, -0.2, 1.0])
    free = gains @ others
    np.testing.assert_allclose(M[1:3, 1:3] @ free + M[1:3, 3:] @ others, 0.0, atol=1e-12)
    all_of = np.concatenate([free, others])
    assert others @ cost @ others == pytest.approx(all_of @ M[1:, 1:] @ all_of, rel=1e-12)


def test_a_direction_of_negative_curvature_has_no_minimum():
    M = np.diag([1.0, -1.0, 1.0])
    assert not elimination.minimize(M, 0, 2, np.empty((2, 1)))[1]


def test_the_cost_to_go_is_added_as_a_function_of_controls_and_state():
    rng = np.random.default_rng(5)
    n_u, n_x, n_next = 2, 3, 4
    F, f, P = rng.normal(size=(n_next, n_u + n_x)), rng.normal(size=n_next), symmetric(6, n_next + 1)
    links = np.argwhere(np.ones_like(F))
    Q, q = symmetric(7, n_u + n_x), rng.normal(size=n_u + n_x)
    place = np.array([1, 0, 2, 3, 4, 5])  # the controls change places
    M = elimination.quadratic(Q, q, n_u, place)
    elimination.add_cost_to_go(M, P, links, F.ravel(), f, place)
    y = rng.normal(size=n_u + n_x)
    following = np.append(F @ y + f, 1.0)
    in_place = np.append(y[[1, 0, 2, 3, 4]], 1.0)
    upper = np.triu(M) + np.triu(M, 1).T
    expected = y @ Q @ y + 2 * q @ y + following @ P @ following
    assert in_place @ upper @ in_place - upper[-1, -1] == pytest.approx(expected - constant_of(P, f), rel=1e-10)


def constant_of(P, f):
    """Return what the cost-to-go is where y is zero."""
    following = np.append(f, 1.0)
    return following @ P @ following
