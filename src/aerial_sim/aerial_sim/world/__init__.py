"""The MuJoCo model of robot and terrain, and what touches what in it."""
