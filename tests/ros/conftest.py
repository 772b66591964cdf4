import time

import pytest
import rclpy
from rclpy.experimental import EventsExecutor

PATIENCE = 10.0  # [s] for anything that nodes in one process do to happen


@pytest.fixture
def executor():
    """One executor for all nodes of a test, in a ROS of its own."""
    rclpy.init()
    executor = EventsExecutor()
    yield executor
    try:
        for node in executor.get_nodes():
            node.destroy_node()
    finally:
        rclpy.try_shutdown()


@pytest.fixture
def until(executor):
    """Spin until something holds: ``until(lambda: ...)``."""

    def until(holds, patience=PATIENCE):
        deadline = time.monotonic() + patience
        while not holds():
            assert time.monotonic() < deadline, "it did not happen in time"
            executor.spin_once(timeout_sec=0.01)

    return until
