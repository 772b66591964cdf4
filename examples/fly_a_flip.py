"""Simulate a back flip in closed loop, judge its landing, and plot the plan against the execution."""

import matplotlib.pyplot as plt

from aerial_evaluation import judge, run
from aerial_model import MotionRequest, Robot

robot = Robot.load("mini_cheetah")
record = run(robot, MotionRequest(motion="back_flip"), seed=1)
landing = judge(record)
print("landed" if landing.landed else f"not landed: {', '.join(landing.failed)}")

plan = record.plan.placed(record.start_frame)
time = record.time - record.start_time
figure, panels = plt.subplots(2, sharex=True, layout="constrained")
for panel, axis, label in zip(panels, (0, 2), ("forward [m]", "up [m]"), strict=True):
    panel.plot(time, record.q[:, axis], label="execution")
    panel.plot(plan.time, plan.q[:, axis], "--", label="plan")
    panel.set_ylabel(label)
panels[0].set_title("Base of the Mini Cheetah in a back flip")
panels[0].legend()
panels[1].set_xlabel("time since the motion began [s]")
figure.savefig("flip.png")
