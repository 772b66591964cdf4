import numpy as np
import pytest

from aerial_model.robot.robot import Robot
from aerial_model.values.command import Command

HOLD_STIFFNESS = 100.0  # [N·m/rad] stiff enough to stand with
HOLD_DAMPING = 2.0  # [N·m·s/rad]


@pytest.fixture(scope="session")
def robot():
    return Robot.load("mini_cheetah")


@pytest.fixture
def torque_command(robot):
    """A command of pure feed-forward torque: ``torque_command(τ)``."""
    zero = np.zeros(robot.n_joints)

    def command(torque):
        return Command(torque=zero + torque, position=zero, velocity=zero, stiffness=zero, damping=zero)

    return command


@pytest.fixture
def hold(robot):
    """A command that holds the home pose by the drives' own gains."""
    zero = np.zeros(robot.n_joints)
    return Command(
        torque=zero,
        position=robot.poses["home"],
        velocity=zero,
        stiffness=zero + HOLD_STIFFNESS,
        damping=zero + HOLD_DAMPING,
    )
