"""Recordings of running nodes, and the verdict on a recorded motion."""
