"""What a world looks like: light, sky, and the materials of floor and boxes. Nothing here has a physical effect."""

from __future__ import annotations

import mujoco

FLOOR_MATERIAL = "floor"
BOX_MATERIAL = "box"
_FLOOR_COLOURS = ((0.93, 0.93, 0.92), (0.87, 0.87, 0.86))
_FLOOR_LINE = (0.74, 0.75, 0.76)
_BOX_COLOUR = (0.42, 0.56, 0.68, 1.0)
_SKY_COLOURS = ((0.96, 0.97, 0.99), (0.72, 0.79, 0.87))
_TILES_PER_METRE = 1.0  # a checker texture has two by two tiles
_SHADOW_MAP = 4096  # [pixel]


def add(spec: mujoco.MjSpec) -> None:
    """Add sky, lights and materials to ``spec``."""
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=_SKY_COLOURS[0],
        rgb2=_SKY_COLOURS[1],
        width=64,
        height=384,
    )
    floor = spec.add_texture(
        name=FLOOR_MATERIAL,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=_FLOOR_COLOURS[0],
        rgb2=_FLOOR_COLOURS[1],
        width=256,
        height=256,
    )
    floor.mark = mujoco.mjtMark.mjMARK_EDGE
    floor.markrgb = _FLOOR_LINE
    material = spec.add_material(name=FLOOR_MATERIAL, texrepeat=[_TILES_PER_METRE] * 2, texuniform=True, reflectance=0.03)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = FLOOR_MATERIAL
    spec.add_material(name=BOX_MATERIAL, rgba=_BOX_COLOUR, specular=0.2)
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[0, 0, 4],
        dir=[0.35, 0.45, -1],
        diffuse=[0.55, 0.55, 0.53],
        specular=[0.2, 0.2, 0.2],
        castshadow=True,
    )
    spec.visual.headlight.ambient = [0.42, 0.42, 0.44]
    spec.visual.headlight.diffuse = [0.28, 0.28, 0.28]
    spec.visual.headlight.specular = [0.05, 0.05, 0.05]
    spec.visual.quality.shadowsize = _SHADOW_MAP
    spec.visual.map.shadowclip = 3
