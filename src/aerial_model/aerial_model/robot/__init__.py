"""A robot as data: its folder, its model, its actuators and contact points."""
