"""The robot as CasADi expressions, and inverse kinematics by them."""
