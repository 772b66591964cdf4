"""A first ``robot.yaml`` for somebody's URDF: feet, poses and motors that it does not name are guessed, and marked as guesses."""
