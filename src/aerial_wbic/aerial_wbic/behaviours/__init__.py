"""What the robot does at a time: stand, follow a plan, come to rest, fold, lie."""
