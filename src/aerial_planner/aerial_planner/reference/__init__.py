"""The kinematic reference of a motion: body path, landing, the legs' path through the flight."""
