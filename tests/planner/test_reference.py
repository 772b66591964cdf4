import numpy as np
import pytest

from aerial_model.posture import giving_way
from aerial_model.request import MotionRequest
from aerial_model.robot import Robot
from aerial_planner.inverse_kinematics import InverseKinematics
from aerial_planner.reference import body_reference
from aerial_planner.schedule import contact_schedule, load_motion
from aerial_planner.settings import PlannerSettings
from aerial_planner.symbolic import base_frame_model


@pytest.mark.parametrize("displacement", [(0.52, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, -0.3, 0.0)], ids=str)
def test_no_leg_lands_as_a_strut(displacement):
    robot = Robot.load("mit_humanoid")
    model, settings = base_frame_model(robot), robot.section("planner", PlannerSettings)
    request = MotionRequest(motion="jump", displacement=np.array(displacement))
    motion = load_motion("jump", robot)
    schedule = contact_schedule(request, motion, robot, settings.dt, settings.flight_knots)
    start = robot.standing_configuration("home")
    reference = body_reference(schedule, start, robot, model, InverseKinematics(robot, model), settings)
    ahead = giving_way(robot, reference.landing_joint_position)
    assert np.all(ahead >= 0.8 * giving_way(robot, robot.poses["landing"]))
