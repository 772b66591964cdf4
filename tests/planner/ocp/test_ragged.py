"""Parts of different sizes in one row."""

import numpy as np

from aerial_planner.ocp.ragged import Ragged, from_rows, part, starts_of, to_rows

COUNTS = [3, 0, 2, 4]


def test_parts_are_where_their_counts_say():
    ragged = Ragged.joined([np.arange(10.0 * k, 10.0 * k + n) for k, n in enumerate(COUNTS)])
    np.testing.assert_array_equal(ragged.starts, [0, 3, 3, 5, 9])
    np.testing.assert_array_equal(part(ragged, 2), [20.0, 21.0])
    np.testing.assert_array_equal(ragged.span(1, 4), [20.0, 21.0, 30.0, 31.0, 32.0, 33.0])


def test_parts_share_the_memory_of_the_row():
    ragged = Ragged.zeros(COUNTS)
    ragged.span(2, 3)[:] = 7.0
    np.testing.assert_array_equal(ragged.values, [0, 0, 0, 7, 7, 0, 0, 0, 0])


def test_rows_of_a_matrix_come_back_from_it():
    starts, values = starts_of(COUNTS), np.random.default_rng(0).normal(size=9)
    rows, back = np.zeros((4, 5)), np.empty(9)
    to_rows(values, starts, rows, -1.0)
    from_rows(rows, starts, back)
    np.testing.assert_array_equal(back, -values)
