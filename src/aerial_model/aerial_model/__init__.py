"""The robot as data, and the quantities exchanged about it."""
