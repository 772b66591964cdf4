"""Numerics that all packages share: rotations, compiled linear algebra, memory layouts."""
