import numpy as np
import pinocchio as pin
from hypothesis import given
from hypothesis import strategies as st

from aerial_model.numerics import rotation

TOLERANCE = 1e-12
near_and_far = st.one_of(st.floats(-3.0, 3.0), st.floats(-1e-7, 1e-7))
vectors = st.tuples(near_and_far, near_and_far, near_and_far).map(np.array)


@given(vectors)
def test_log_inverts_exp_below_half_a_turn(phi):
    phi = phi * min(1.0, 3.1 / max(1e-12, np.linalg.norm(phi)))
    np.testing.assert_allclose(rotation.log(rotation.exp(phi)), phi, atol=1e-9)


@given(vectors, vectors)
def test_matrix_of_a_product_is_the_product_of_matrices(a, b):
    qa, qb = rotation.exp(a), rotation.exp(b)
    product = rotation.matrix(qa) @ rotation.matrix(qb)
    np.testing.assert_allclose(rotation.matrix(rotation.multiply(qa, qb)), product, atol=TOLERANCE)


@given(vectors)
def test_exp_agrees_with_pinocchio(phi):
    np.testing.assert_allclose(rotation.matrix(rotation.exp(phi)), pin.exp3(phi), atol=1e-9)


@given(st.floats(-3.1, 3.1))
def test_heading_of_a_turn_about_z_is_its_angle(yaw):
    assert abs(rotation.heading(rotation.about_z(yaw)) - yaw) < TOLERANCE


def test_tilt_is_the_angle_to_the_vertical_whatever_the_heading():
    leaning = rotation.multiply(rotation.about_z(1.0), rotation.exp(np.array([0.3, 0.0, 0.0])))
    assert abs(rotation.tilt(leaning) - 0.3) < TOLERANCE
