import numpy as np
import pinocchio as pin
import pytest

from aerial_model.kinematics import Kinematics
from aerial_model.robot.contact import holding_rows
from aerial_model.robot.robot import Robot


def held(robot, mask):
    """The Jacobian of the rows that hold, and of all rows of the held points, in the home pose."""
    q = robot.standing_configuration()
    state = Kinematics(robot).at(q, np.zeros(robot.model.nv))
    rows = np.array([state.J_contacts[i, axis] for i, axis in robot.holding_rows(mask)])
    return rows, state.J_contacts[np.asarray(mask, dtype=bool)].reshape(-1, robot.model.nv)


@pytest.mark.parametrize(
    ("name", "mask", "expected"),
    [
        ("mini_cheetah", (1, 1, 1, 1), 12),
        ("mini_cheetah", (0, 1, 0, 1), 6),
        ("mit_humanoid", (1, 1, 1, 1), 10),  # toe and heel of a foot: five numbers
        ("mit_humanoid", (1, 0, 1, 0), 6),
        ("mit_humanoid", (0, 1, 0, 0), 3),
        ("mini_cheetah", (0, 0, 0, 0), 0),
    ],
)
def test_as_many_rows_as_hold_and_none_twice(name, mask, expected):
    rows, everything = held(Robot.load(name), mask)
    assert len(rows) == expected
    if expected:
        assert np.linalg.matrix_rank(rows, tol=1e-6) == expected
        assert np.linalg.matrix_rank(np.vstack([rows, everything]), tol=1e-6) == expected


def test_a_sole_of_four_corners_is_held_by_six():
    robot = Robot.load("mit_humanoid")
    frame = robot.model.getFrameId("r_foot")
    corners = []
    for k, offset in enumerate(((0.08, 0.03), (0.08, -0.03), (-0.05, 0.03), (-0.05, -0.03))):
        parent = robot.model.frames[frame]
        placement = parent.placement * pin.SE3(np.eye(3), np.array([*offset, -0.03]))
        corners.append(
            robot.model.addFrame(pin.Frame(f"corner {k}", parent.parentJoint, frame, placement, pin.FrameType.OP_FRAME))
        )
    assert len(holding_rows(robot.model, corners, [True] * 4, robot.poses["home"])) == 6
    assert len(holding_rows(robot.model, corners, [True] * 3 + [False], robot.poses["home"])) == 6
    assert len(holding_rows(robot.model, corners, [True, False, True, False], robot.poses["home"])) == 5
