"""Pictures of a robot and its terrain, by ray casting."""

from aerial_sim.picture.picture import Footage, frames, save, save_animation, strobe
from aerial_sim.picture.raycast import Camera, render
from aerial_sim.picture.still_life import StillLife, compose

__all__ = ["Camera", "Footage", "StillLife", "compose", "frames", "render", "save", "save_animation", "strobe"]
