"""Plan a jump of the Mini Cheetah and print its figures."""

import numpy as np

from aerial_model import MotionRequest, RefusalError, Robot
from aerial_planner import Planner

robot = Robot.load("mini_cheetah")
planner = Planner(robot)
result = planner.plan(MotionRequest(motion="jump", displacement=np.array([0.4, 0.0, 0.0])))
plan, use = result.plan, result.actuator_use

print(f"planned in {result.report.total_time_s:.2f} s")
print(f"lift-off after {plan.take_off_time:.2f} s, touchdown after {plan.landing_time:.2f} s")
print(
    f"the centre of mass rises to {plan.com[:, 2].max():.2f} m, the feet push with {plan.force.sum(axis=1).max():.0f} N"
)
print(f"torques reach {use.torque_ratio.max():.0%} of their limits, voltages {use.voltage_ratio.max():.0%}")

try:
    planner.plan(MotionRequest(motion="jump", displacement=np.array([3.0, 0.0, 0.0])))
except RefusalError as refusal:
    print(f"three metres: {refusal.reason}")
