"""Where the robot is, and which of its contact points bear load."""
