"""The compiled formulas: linear algebra against numpy, and that no tick has to compile anything."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from aerial_model.numerics.linalg import cholesky, cholesky_solve, invert
from aerial_model.values.plan_file import save_plan

ROUNDING = 1e-10
TICKS_OF_EVERYTHING = Path(__file__).with_name("ticks_of_everything.py")


@pytest.mark.parametrize("m", [1, 3, 12])
def test_factor_and_solution_are_numpys(m):
    random = np.random.default_rng(m)
    A = random.normal(size=(m, m))
    A = A @ A.T + 0.1 * np.eye(m)
    B = random.normal(size=(m, 2))
    L, X = np.zeros((m, m)), B.copy()
    least = cholesky(A, L)
    cholesky_solve(L, X)
    np.testing.assert_allclose(L, np.linalg.cholesky(A), atol=ROUNDING)
    np.testing.assert_allclose(A @ X, B, atol=ROUNDING)
    assert least == pytest.approx(L.diagonal().min() ** 2)


def test_a_matrix_that_is_not_positive_is_told_by_its_pivot():
    A = np.diag([1.0, -2.0, 3.0])
    assert cholesky(A, np.zeros((3, 3))) == -2.0


@pytest.mark.parametrize("m", [1, 3, 6])
def test_the_inverse_is_numpys(m):
    A = np.random.default_rng(m).normal(size=(m, m))[::-1].copy()
    X = np.zeros((m, m))
    invert(A, X)
    np.testing.assert_allclose(X, np.linalg.inv(A), rtol=1e-9)


@pytest.mark.parametrize("A", [np.zeros((3, 3)), np.full((3, 3), np.nan), np.ones((3, 3))])
def test_without_an_inverse_nothing_is_raised_and_nothing_finite_claimed(A):
    X = np.zeros((3, 3))
    invert(A, X)
    assert not np.isfinite(X).all()


def test_no_tick_compiles_anything(hop, tmp_path):
    """In a process of its own: what other tests have compiled would hide it."""
    save_plan(hop, tmp_path / "hop.npz")
    process = subprocess.run(
        [sys.executable, TICKS_OF_EVERYTHING, tmp_path / "hop.npz"], capture_output=True, text=True
    )
    assert (process.returncode, process.stdout.strip()) == (0, "compiled in a tick: nothing"), process.stderr
