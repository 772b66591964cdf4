"""What a robot has between a command and its joints, and between its sensors and a state."""
