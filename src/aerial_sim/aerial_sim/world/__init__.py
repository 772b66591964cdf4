"""The MuJoCo model of robot and terrain, where terrain comes to lie in it, and what touches what."""

from aerial_sim.world.contacts import ContactSensing
from aerial_sim.world.placement import placed
from aerial_sim.world.world import World, build

__all__ = ["ContactSensing", "World", "build", "placed"]
