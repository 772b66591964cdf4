"""What spans a collision shape, on shapes whose extent is known."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

from aerial_model.robot.shapes import lowest, spanning_points

UPSIDE = pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0]))
ON_ITS_SIDE = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3))


def shape(geometry, placement=None):
    """A shape in the frame of its joint."""
    return pin.GeometryObject("shape", 0, 0, placement or pin.SE3.Identity(), geometry)


@pytest.mark.parametrize(
    ("geometry", "half_extent"),
    [
        (coal.Box(0.2, 0.4, 0.6), [0.1, 0.2, 0.3]),
        (coal.Sphere(0.1), [0.1, 0.1, 0.1]),
        (coal.Cylinder(0.1, 0.6), [0.1, 0.1, 0.3]),
        (coal.Capsule(0.1, 0.6), [0.1, 0.1, 0.4]),
    ],
)
def test_points_span_the_shape_and_no_more(geometry, half_extent):
    points = spanning_points(shape(geometry))
    np.testing.assert_allclose(points.max(axis=0), half_extent, atol=1e-12)
    np.testing.assert_allclose(points.min(axis=0), -np.array(half_extent), atol=1e-12)


def test_points_are_where_the_shape_is_in_its_joint():
    points = spanning_points(shape(coal.Cylinder(0.1, 0.6), UPSIDE * ON_ITS_SIDE))
    np.testing.assert_allclose(np.ptp(points, axis=0), [0.2, 0.6, 0.2], atol=1e-12)
    np.testing.assert_allclose(points.mean(axis=0), [0.0, 0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(("geometry", "height"), [(coal.Sphere(0.1), 0.9), (coal.Box(0.2, 0.4, 0.6), 0.8)])
def test_the_lowest_point_of_a_shape_on_a_joint_that_is_turned(geometry, height):
    assert lowest(shape(geometry), UPSIDE * ON_ITS_SIDE) == pytest.approx(height)


def test_a_shape_that_nothing_spans_is_never_the_lowest():
    plane = shape(coal.Halfspace())
    assert len(spanning_points(plane)) == 0
    assert lowest(plane, UPSIDE) == np.inf
