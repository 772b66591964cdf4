"""Strict priorities, whatever the tasks: full, conflicting, redundant or exhausted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerial_wbic.tasks.hierarchy import Task, owned_rows

NV = 10
TOLERANCE = 1e-7  # relative to tasks and accelerations of order 1
ACCELERATION_MAX = 1e4  # what no sane command exceeds for tasks of order 1

seeds = st.integers(0, 2**32 - 1)


def inertia(random: np.random.Generator) -> np.ndarray:
    A = random.normal(size=(NV, NV))
    return A @ A.T / NV + 0.1 * np.eye(NV)


def orthonormal(random: np.random.Generator, rows: int) -> np.ndarray:
    return np.linalg.qr(random.normal(size=(NV, NV)))[0][:rows]


def task(random: np.random.Generator, J: np.ndarray) -> Task:
    return Task(J=J, a=random.normal(size=len(J)), xdot=random.normal(size=len(J)))


@given(seeds, st.lists(st.integers(0, 6), min_size=2, max_size=4))
def test_a_lower_task_never_disturbs_a_higher_one(prioritized, seed, rows):
    random = np.random.default_rng(seed)
    H, tasks = inertia(random), tuple(task(random, orthonormal(random, m)) for m in rows)
    before = prioritized(H, tasks[:-1])
    after = prioritized(H, tasks)
    for higher in tasks[:-1]:
        for old, new in zip(before, after, strict=True):
            np.testing.assert_allclose(higher.J @ new, higher.J @ old, atol=TOLERANCE * max(1, np.abs(new).max()))


@given(seeds, st.integers(1, 4), st.integers(1, 4))
def test_tasks_that_fit_together_are_all_met(prioritized, seed, first, second):
    random = np.random.default_rng(seed)
    J = orthonormal(random, first + second)
    tasks = (task(random, J[:first]), task(random, J[first:] + random.normal(size=(second, first)) @ J[:first]))
    vdot, v = prioritized(inertia(random), tasks)
    for each in tasks:
        np.testing.assert_allclose(each.J @ vdot, each.a, atol=TOLERANCE * max(1, np.abs(vdot).max()))
        np.testing.assert_allclose(each.J @ v, each.xdot, atol=TOLERANCE * max(1, np.abs(v).max()))


@given(seeds)
def test_a_conflicting_task_gives_way_without_blowing_up(prioritized, seed):
    random = np.random.default_rng(seed)
    above = task(random, orthonormal(random, 5))
    against = Task(J=above.J[:3], a=above.a[:3] + 1.0, xdot=above.xdot[:3] + 1.0)
    H = inertia(random)
    vdot, _ = prioritized(H, (above, against))
    np.testing.assert_allclose(vdot, prioritized(H, (above,))[0], atol=TOLERANCE)


@given(seeds)
def test_a_task_with_no_freedom_left_changes_nothing(prioritized, seed):
    random = np.random.default_rng(seed)
    J = orthonormal(random, NV)
    above = (task(random, J[:6]), task(random, J[6:]))
    H = inertia(random)
    vdot, _ = prioritized(H, (*above, task(random, orthonormal(random, 3))))
    np.testing.assert_array_equal(vdot, prioritized(H, above)[0])


@given(seeds, st.integers(1, 3))
def test_a_task_of_lower_rank_does_not_blow_up(prioritized, seed, rank):
    random = np.random.default_rng(seed)
    H = inertia(random)
    redundant = task(random, random.normal(size=(5, rank)) @ orthonormal(random, rank))
    vdot, _ = prioritized(H, (redundant,))
    assert np.abs(vdot).max() < ACCELERATION_MAX


@given(seeds)
def test_what_no_task_asks_for_has_the_least_kinetic_energy(prioritized, seed):
    random = np.random.default_rng(seed)
    H, only = inertia(random), task(random, orthonormal(random, 4))
    vdot, _ = prioritized(H, (only,))
    _, _, Vt = np.linalg.svd(only.J)
    free = Vt[4:].T  # any acceleration that the task does not feel
    np.testing.assert_allclose(free.T @ H @ vdot, 0.0, atol=1e-6)


def test_tasks_without_rows_ask_for_nothing(prioritized):
    empty = Task(J=np.zeros((0, NV)), a=np.zeros(0), xdot=np.zeros(0))
    vdot, v = prioritized(np.eye(NV), (empty,))
    assert not vdot.any()
    assert not v.any()


@pytest.mark.parametrize("rank", [0, 1, 2, 3])
def test_the_rank_counts_what_is_left_not_rounding_noise(rank):
    random = np.random.default_rng(rank)
    J = np.zeros((3, NV))
    J[:rank] = random.normal(size=(rank, NV))
    J += 1e-14 * random.normal(size=(3, NV))
    rows = np.hstack([J, np.ones((3, 2))])
    assert owned_rows(rows, 0.01) == rank
    np.testing.assert_allclose(rows[:rank, :NV] @ rows[:rank, :NV].T, np.eye(rank), atol=TOLERANCE)
    assert np.abs(rows[:rank]).max(initial=0.0) < ACCELERATION_MAX
