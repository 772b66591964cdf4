"""Compiled linear algebra against NumPy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerial_model.numerics.linalg import cholesky, cholesky_solve, invert, lower_solve, upper_solve

TOLERANCE = 1e-9  # relative


def random_matrix(seed, m):
    """A well-conditioned matrix ``(m, m)``."""
    random = np.random.default_rng(seed)
    return random.normal(size=(m, m)) + m * np.diag(random.choice([-1.0, 1.0], m))


seeds, sizes = st.integers(0, 2**32 - 1), st.integers(1, 8)


@given(seeds, sizes)
def test_a_factor_times_its_transpose_is_the_matrix(seed, m):
    A = random_matrix(seed, m)
    A = A @ A.T
    L = np.zeros((m, m))
    least = cholesky(A, L)
    np.testing.assert_allclose(L @ L.T, A, rtol=TOLERANCE, atol=TOLERANCE)
    assert least == pytest.approx(np.diag(L).min() ** 2)


@given(seeds, st.integers(2, 8))
def test_a_matrix_that_is_not_positive_has_no_positive_least_pivot(seed, m):
    vectors = np.linalg.qr(random_matrix(seed, m))[0]
    A = vectors @ np.diag([-1.0, *np.arange(1.0, m)]) @ vectors.T
    assert cholesky(A, np.zeros((m, m))) <= 0.0


@given(seeds, sizes, st.integers(1, 3))
def test_solutions_are_numpys(seed, m, k):
    A = random_matrix(seed, m)
    A = A @ A.T
    L, B = np.linalg.cholesky(A), np.random.default_rng(seed).normal(size=(m, k))
    solutions = []
    for solve in (lower_solve, upper_solve, cholesky_solve):
        X = B.copy()
        solve(L, X)
        solutions.append(X)
    for X, matrix in zip(solutions, (L, L.T, A), strict=True):
        np.testing.assert_allclose(X, np.linalg.solve(matrix, B), rtol=1e-6, atol=1e-8)


@given(seeds, sizes)
def test_an_inverse_is_numpys(seed, m):
    A, X = random_matrix(seed, m), np.zeros((m, m))
    kept = A.copy()
    invert(A, X)
    np.testing.assert_allclose(X, np.linalg.inv(A), rtol=1e-6, atol=1e-8)
    np.testing.assert_array_equal(A, kept)


def test_the_inverse_of_a_singular_matrix_is_not_finite_and_no_error():
    X = np.zeros((2, 2))
    invert(np.ones((2, 2)), X)
    assert not np.isfinite(X).all()
