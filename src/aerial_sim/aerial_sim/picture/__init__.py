"""Pictures of a robot and its terrain, by ray casting."""
