"""What the controller's tests share."""

from __future__ import annotations

import pytest

from aerial_model.robot import Robot


@pytest.fixture(scope="session")
def robot() -> Robot:
    return Robot.load("mini_cheetah")
