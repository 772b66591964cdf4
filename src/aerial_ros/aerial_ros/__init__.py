"""The border to ROS that all nodes share: messages from and to the model's types, and how a node lives."""
