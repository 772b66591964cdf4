"""From joint torques to measurements: the robot and its world in MuJoCo."""
