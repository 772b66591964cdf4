"""Parts of one block of memory: none lies on another, and they are the block's memory."""

from __future__ import annotations

import numpy as np
import pytest

from aerial_model.numerics.layout import cut, cut_flags, cut_rows, flags_size


def test_parts_follow_each_other():
    block = np.arange(12.0)
    first, at = cut(block, 1, 3)
    second, at = cut_rows(block, at, 2, 3)
    np.testing.assert_array_equal(first, [1, 2, 3])
    np.testing.assert_array_equal(second, [[4, 5, 6], [7, 8, 9]])
    assert at == 10


def test_parts_are_the_blocks_memory():
    block = np.zeros(8)
    rows, _ = cut_rows(block, 2, 2, 3)
    rows[1, 2] = 5.0
    block[2] = 3.0
    assert block[7] == 5.0
    assert rows[0, 0] == 3.0


@pytest.mark.parametrize("size", [1, 4, 8, 9])
def test_flags_take_a_byte_each(size):
    block = np.zeros(4)
    flags, at = cut_flags(block, 1, size)
    flags[:] = True
    assert flags.shape == (size,)
    assert at == 1 + flags_size(size)
    assert block[0] == 0.0
    assert not block[at:].any()
