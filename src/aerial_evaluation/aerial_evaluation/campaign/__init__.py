"""Many seeded trials of one motion."""
