"""What all nodes share: how they live, how well topics are served, and messages as the model's values."""

from aerial_ros.latency import Latency
from aerial_ros.node import AerialNode
from aerial_ros.wire import CommandWire, StateWire

__all__ = ["AerialNode", "CommandWire", "Latency", "StateWire"]
