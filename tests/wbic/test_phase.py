"""What the phases ask for when the ground does not come when the plan says."""

import dataclasses

import numpy as np
import pytest

from aerial_model.robot.robot import JOINT_VELOCITY
from aerial_wbic.behaviours.phase import Phase, Phases
from aerial_wbic.gains import Touchdown


@pytest.mark.parametrize(("late", "share"), [(-0.004, 1.0), (0.0, 1.0), (0.004, 0.0), (0.02, 0.0)])
def test_who_waits_for_a_contact_keeps_the_landing_pose_still(robot, gains, state_at, hop, late, share):
    v = hop.v.copy()
    v[-2:, JOINT_VELOCITY] = 3.0  # legs are drawn up as they land
    plan = dataclasses.replace(hop, v=v)
    phases = Phases(robot, dataclasses.replace(gains, touchdown=Touchdown.CONTACT), 0.25)
    phases.follow(plan)
    for time in (0.0, plan.take_off_time, plan.landing_time + late):
        phases.tick(time)
    target = phases.target(state_at())
    assert phases.phase is Phase.FLIGHT
    np.testing.assert_allclose(target.joint_velocity, share * 3.0)
    if late >= 0:
        np.testing.assert_allclose(target.joint_position, plan.landing_joint_position)
