"""Where the robot is, from its sensors, and which contact points bear load, from its joints."""

from aerial_wbic.estimation.estimator import Estimator
from aerial_wbic.estimation.touchdown import ContactSense

__all__ = ["ContactSense", "Estimator"]
