"""Arithmetic on tuples of components against NumPy's on arrays."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from aerial_model.numerics import rotation
from aerial_model.numerics.components import cross_of, inverse_of, product_of, quaternion, sum_of, vector

number = st.floats(-10.0, 10.0)
vectors = st.tuples(number, number, number)


@given(vectors, vectors, number)
def test_a_sum_is_scaled_in_its_second_term(a, b, scale):
    np.testing.assert_allclose(sum_of(a, b, scale), np.array(a) + scale * np.array(b), atol=1e-12)


@given(vectors, vectors)
def test_a_cross_product_is_numpys(a, b):
    np.testing.assert_allclose(cross_of(a, b), np.cross(a, b), atol=1e-12)


@given(vectors)
def test_a_quaternion_times_its_inverse_turns_nothing(phi):
    q = quaternion(rotation.exp(np.array(phi)))
    np.testing.assert_allclose(product_of(q, inverse_of(q)), rotation.IDENTITY, atol=1e-12)


def test_components_are_those_of_the_array():
    assert vector(np.array([1.0, 2.0, 3.0])) == (1.0, 2.0, 3.0)
    assert quaternion(np.arange(4.0)) == (0.0, 1.0, 2.0, 3.0)
