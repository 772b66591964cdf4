"""One planner for all tests of this folder: its problems are built once."""

import numpy as np
import pytest

from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.planner import Planner


@pytest.fixture(scope="session")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture(scope="session")
def planner(robot):
    return Planner(robot)


@pytest.fixture(scope="session")
def forward(planner):
    """A forward jump of 0.4 m."""
    return planner.plan(jump(0.4, 0.0))


def jump(x, y, z=0.0, **options):
    return MotionRequest(motion="jump", displacement=np.array([x, y, z]), **options)
