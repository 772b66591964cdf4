"""The structures of a tick fill the blocks they lie in, and none of their arrays lies on another."""

from __future__ import annotations

import numpy as np
import pytest

from aerial_model.kinematics import Kinematics
from aerial_model.robot.robot import Robot
from aerial_wbic.force_qp.solvers import blank_program
from aerial_wbic.gains import ControllerGains
from aerial_wbic.target import blank_target


def arrays(structure):
    """All arrays of a structure and of those in it."""
    for value in structure:
        if isinstance(value, tuple):
            yield from arrays(value)
        elif isinstance(value, np.ndarray) and value is not getattr(structure, "block", None):
            yield value


@pytest.mark.parametrize("name", ["mini_cheetah", "mit_humanoid"])
@pytest.mark.parametrize("kind", ["configuration", "target", "program"])
def test_a_structure_fills_its_block(name, kind):
    robot = Robot.load(name)
    gains = robot.section("controller", ControllerGains)
    structure = {
        "configuration": lambda: Kinematics(robot).blank(),
        "target": lambda: blank_target(robot.n_joints, robot.n_contacts, gains.hold),
        "program": lambda: blank_program(3 * robot.n_contacts, 5 * robot.n_contacts, 1.0, 1.0),
    }[kind]()
    structure.block[:] = 0.0
    for array in arrays(structure):
        array[:] = 1
    filled = structure.block != 0.0
    header = int(np.argmax(filled))
    assert filled[header:].all()
    assert sum(array.nbytes for array in arrays(structure)) <= filled.sum() * structure.block.itemsize
    assert sum(array.nbytes for array in arrays(structure)) > (filled.sum() - 1) * structure.block.itemsize
