"""From a motion and a goal to a checked plan."""
