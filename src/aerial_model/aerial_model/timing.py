"""The period of the control loop, which planner, controller and simulator must agree on."""

CONTROL_PERIOD = 0.002  # [s] from one state to the next, for which a command's torques hold
