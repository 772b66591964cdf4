"""The simulator as a ROS 2 node, and the ground truth it publishes as a value."""

from aerial_sim.ros.messages import ground_truth_from_message, ground_truth_to_message

__all__ = ["ground_truth_from_message", "ground_truth_to_message"]
