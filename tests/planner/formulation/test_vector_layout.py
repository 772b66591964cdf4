"""Layouts: numbers come back as they were packed, symbols lie where numbers do, and misfits are errors."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerial_planner.formulation.kino_dynamic_layouts import KinoDynamicLayouts
from aerial_planner.formulation.srbm_stages import BodyLayouts
from aerial_planner.formulation.vector_layout import StageLayout, StageSymbols, VectorLayout

SHAPES = st.lists(st.sampled_from([(), (1,), (0,), (3,), (2, 3), (3, 2), (3, 0)]), max_size=6)
LAYOUT = VectorLayout("state", height=(), position=(3,), feet=(3, 2))
SIZES = {"n": 12, "n_whole": 14, "n_c": 4, "n_a": 2, "n_limited": 4}


def stage_layouts():
    stages = []
    for timed in (False, True):
        layouts = KinoDynamicLayouts(**SIZES, timed=timed)
        stages += (layouts.take_off(n_loaded=2, n_ending=6), layouts.take_off(n_loaded=0, ends_phase=timed))
        stages += (layouts.lift_off, layouts.flight, layouts.touchdown)
    body = BodyLayouts(n_c=4)
    return [*stages, body.take_off(3), body.lift_off, body.flight, body.touchdown]


def numbers(layout, leading=()):
    rng = np.random.default_rng(0)
    return {name: rng.normal(size=(*leading, *shape)) for name, shape in layout.entries.items()}


@given(shapes=SHAPES, leading=st.sampled_from([(), (4,), (2, 3)]))
def test_unpack_is_the_inverse_of_pack(shapes, leading):
    layout = VectorLayout("vector", **{f"entry_{i}": shape for i, shape in enumerate(shapes)})
    values = numbers(layout, leading)
    packed = layout.pack(**values)
    assert packed.shape[-1] == layout.size
    unpacked = layout.unpack(packed)
    assert list(unpacked) == list(values)
    for name, value in values.items():
        np.testing.assert_array_equal(unpacked[name], value)


@pytest.mark.parametrize("stage", stage_layouts(), ids=lambda stage: stage.state.what)
def test_the_numbers_of_every_stage_come_back(stage):
    for layout in (stage.state, stage.control, stage.parameters):
        values = numbers(layout, (3,))
        unpacked = layout.unpack(layout.pack(**values))
        for name, value in values.items():
            np.testing.assert_array_equal(unpacked[name], value)


@pytest.mark.parametrize("stage", stage_layouts(), ids=lambda stage: stage.state.what)
def test_a_symbol_stands_for_the_number_packed_by_its_name(stage):
    s = StageSymbols(stage)
    for layout, vector in ((stage.state, s.x), (stage.control, s.u), (stage.parameters, s.p)):
        values = numbers(layout)
        read = ca.Function("read", [vector], [getattr(s, name) for name in layout.entries])
        for found, (name, value) in zip(read.call([layout.pack(**values)]), values.items(), strict=True):
            np.testing.assert_array_equal(np.asarray(found).reshape(value.shape), value, err_msg=name)


def test_one_entry_for_all_rows_is_repeated():
    packed = LAYOUT.pack(height=1.0, position=np.arange(6.0).reshape(2, 3), feet=np.zeros((3, 2)))
    np.testing.assert_array_equal(packed[:, :4], [[1, 0, 1, 2], [1, 3, 4, 5]])


def test_entries_without_a_bound_have_none():
    bound = LAYOUT.filled(np.inf, position=[1.0, 2.0, 3.0])
    np.testing.assert_array_equal(bound, [np.inf, 1, 2, 3, *[np.inf] * 6])


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            {"positon": np.zeros(3)},
            "state: unknown entry 'positon' .did you mean 'position'.*known: height, position, feet",
        ),
        ({"position": np.zeros(2)}, r"state: expected position of shape \(3,\), found \(2,\)"),
        ({"feet": np.zeros((2, 3))}, r"state: expected feet of shape \(3, 2\), found \(2, 3\)"),
        ({"feet": np.zeros(3)}, r"state: expected feet of shape \(3, 2\), found \(3,\)"),
    ],
)
def test_a_misnamed_or_misshapen_entry_is_an_error(change, sentence):
    with pytest.raises(ValueError, match=sentence):
        LAYOUT.pack(**({"height": 0.0, "position": np.zeros(3), "feet": np.zeros((3, 2))} | change))


def test_a_missing_entry_is_an_error():
    with pytest.raises(ValueError, match="state: expected height, position, feet, missing position, feet"):
        LAYOUT.pack(height=0.0)


def test_a_misshapen_expression_is_an_error():
    with pytest.raises(ValueError, match=r"state: expected position of shape \(3,\), found \(2, 1\)"):
        LAYOUT.join(height=ca.SX(0), position=ca.SX.zeros(2), feet=ca.SX.zeros(3, 2))


def test_vectors_of_another_size_are_an_error():
    with pytest.raises(ValueError, match=r"state: expected 10 numbers, found shape \(9,\)"):
        LAYOUT.unpack(np.zeros(9))


def test_an_unknown_symbol_is_an_error():
    nothing = VectorLayout("nothing")
    s = StageSymbols(StageLayout(state=LAYOUT, control=nothing, parameters=nothing))
    with pytest.raises(
        AttributeError, match=r"no entry 'feets' \(did you mean 'feet'\?\); known: height, position, feet"
    ):
        _ = s.feets


def test_two_entries_of_one_name_are_an_error():
    with pytest.raises(ValueError, match="state: expected names of one entry each, found twice: height"):
        StageLayout(state=LAYOUT, control=VectorLayout("control", height=()), parameters=VectorLayout("parameters"))
