"""From a plan and measurements to joint torques, 500 times a second."""
