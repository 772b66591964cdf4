import pytest

from aerial_model.robot.robot import Robot
from aerial_model.robot.scale import Scale, Unit

LARGER = Scale(mass=8.0, length=4.0)  # times twice as long


def test_the_reference_robot_is_as_large_as_itself():
    assert Robot.load("mini_cheetah").scale == Scale()


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        (Unit(), 1.0),
        (Unit(time=1), 2.0),
        (Unit(length=1, time=-1), 2.0),  # speeds
        (Unit(length=1, time=-2), 1.0),  # accelerations: gravity is the same
        (Unit(mass=1, length=1, time=-2), 8.0),  # forces go with the weight
        (Unit(mass=1, length=2, time=-2), 32.0),  # torques
    ],
)
def test_similar_robots_move_alike(unit, factor):
    assert LARGER.factor(unit) == pytest.approx(factor)


def test_numbers_in_nested_mappings_are_scaled_by_the_longest_path_that_fits():
    units = {"stiffness": Unit(time=-2), "arm.stiffness": Unit(), "range": Unit(time=1)}
    data = {
        "leg": {"stiffness": 400.0, "name": "stiff"},
        "arm": {"stiffness": 400.0},
        "phases": [{"range": [1.0, 2.0], "contacts": "all"}],
    }
    assert LARGER.applied(data, units) == {
        "leg": {"stiffness": 100.0, "name": "stiff"},
        "arm": {"stiffness": 400.0},
        "phases": [{"range": [2.0, 4.0], "contacts": "all"}],
    }
    assert data["leg"]["stiffness"] == 400.0
