"""A solver for multi-stage optimal control problems, which knows no robot."""
