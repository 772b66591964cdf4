"""Parts of one block of memory: none lies on another, and they are the block's memory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from aerial_model.numerics.layout import Layout


class Gains(NamedTuple):
    stiffness: float
    damping: float


class Body(NamedTuple):
    com: np.ndarray
    gains: Gains


class Target(NamedTuple):
    body: Body
    force: np.ndarray
    contact: np.ndarray
    after: np.ndarray
    jacobians: np.ndarray
    block: np.ndarray


LAYOUT = Layout(
    sizes=("n", "n_c"),
    numbers=("body.gains.stiffness", "body.gains.damping"),
    arrays={
        "body.com": (3,),
        "force": ("n_c", 3),
        "contact": ("n_c",),
        "after": ("2 * n - 1",),
        "jacobians": ("n_c", 3, "n"),
    },
    flags={"contact"},
)
target_in = LAYOUT.reader(Target)


def made(n=2, n_c=9):
    return target_in(LAYOUT.block(n=n, n_c=n_c, body__gains__stiffness=7.0, body__gains__damping=0.5))


def test_arrays_have_the_declared_shapes_and_numbers_their_values():
    target = made()
    shapes = [array.shape for array in (target.body.com, *target[1:5])]
    assert shapes == [(3,), (9, 3), (9,), (3,), (9, 3, 2)]
    assert target.contact.dtype == bool
    assert target.body.gains == Gains(stiffness=7.0, damping=0.5)


@pytest.mark.parametrize("n_c", [1, 7, 8, 9, 16])
def test_arrays_fill_the_block_in_order_and_none_lies_on_another(n_c):
    target = made(n_c=n_c)
    arrays = [target.body.com, target.force, target.contact, target.after, target.jacobians]
    starts = [array.ctypes.data for array in arrays]
    ends = [array.ctypes.data + array.nbytes for array in arrays]
    assert starts[0] == target.block.ctypes.data + 4 * 8
    assert ends[-1] == target.block.ctypes.data + target.block.nbytes
    gaps = [start - end for start, end in zip(starts[1:], ends[:-1], strict=True)]
    assert gaps == [0, 0, -n_c % 8, 0]  # truth values are followed by what fills their last number


def test_arrays_are_the_blocks_memory():
    target = made()
    target.jacobians[8, 2, 1] = 5.0
    target.block[4] = 3.0
    assert target.block[-1] == 5.0
    assert target.body.com[0] == 3.0


def test_a_block_of_whole_numbers():
    layout = Layout(sizes=("n_c",), arrays={"after": ("n_c",)}, kind=int)
    assert layout.block(n_c=3).tolist() == [3, 0, 0, 0]


def test_a_block_is_made_from_all_that_its_layout_begins_with():
    with pytest.raises(TypeError, match="is made from n, n_c, body__gains__stiffness"):
        LAYOUT.block(n=2, n_c=4)


def test_a_field_that_the_layout_does_not_declare_is_named():
    class Other(NamedTuple):
        com: np.ndarray

    with pytest.raises(TypeError, match=r"Other\.com: the layout has no 'com'"):
        LAYOUT.reader(Other)
