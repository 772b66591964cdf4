"""What a real robot brings along between its computer and the physics: motor boards, their watchdog, and sensors."""

from aerial_sim.robot_side.motor_board import MotorBoards
from aerial_sim.robot_side.sensors import SensorNoise, Sensors
from aerial_sim.robot_side.watchdog import Watchdog

__all__ = ["MotorBoards", "SensorNoise", "Sensors", "Watchdog"]
