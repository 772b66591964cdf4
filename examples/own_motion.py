"""Plan and print a motion of your own: it is data, a mapping with the keys of a motion's YAML file."""

import numpy as np

from aerial_model import MotionRequest, Robot
from aerial_planner import Motion, Planner

TWIST = Motion.from_mapping(
    {
        "summary": "hop aside with a quarter turn, the hind feet pushing last",
        "take_off": [{"contacts": "all", "duration": 0.30}, {"contacts": "rear", "duration": 0.08}],
        "rotation": {"axis": [0.0, 0.0, 1.0], "turns": 0.25, "at_lift_off": 0.2},
        "flight": {"clearance": 0.12},
        "displacement": [0.1, 0.1, 0.0],
        "goal": ["rotation", "displacement"],
    }
)

robot = Robot.load("mini_cheetah")
plan = Planner(robot).plan(MotionRequest(motion="twist"), motion=TWIST).plan

print(f"{plan.motion}: {plan.time[-1]:.2f} s, {np.degrees(plan.landing_yaw):.0f}° to the left")
for time, contact in zip(plan.time, plan.contact, strict=True):
    print(
        f"{time:5.2f} s  " + " ".join(p.name if c else "--" for p, c in zip(robot.contact_points, contact, strict=True))
    )
