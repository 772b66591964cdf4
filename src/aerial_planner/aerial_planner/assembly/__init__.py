"""From an optimum to a checked plan."""
