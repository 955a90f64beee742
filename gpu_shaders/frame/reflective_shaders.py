"""Declaration of the pass that draws reflective shadow maps."""

from enum import IntEnum

from ...device.shader import Shader
from .shaders import SURFACE_DEFINES, SURFACE_SAMPLERS, SURFACE_VARYINGS
from .structs import INSTANCE, LIGHT, LIGHT_DEFINES, MAP_DEFINES, MAP_FACE, MATERIAL


class SourceKind(IntEnum):
    """What a texel of an atlas of light sources stands for, in its normal's fourth channel; 0: nothing."""

    BOUNCE = 1  # light that a lamp's surroundings reflect
    EMISSION = 2  # an emissive surface
    CACHE = 3  # a point of a surface, for the light that it reflects after more bounces
    SKY = 4  # a patch of the world's background, far away


SOURCE_DEFINES = tuple((f"SOURCE_{kind.name}", str(int(kind))) for kind in SourceKind)

REFLECT = Shader(
    name="frame_reflective_draw",
    vertex="frame/frame_draw_vert.glsl",
    fragment="frame/reflective_draw_frag.glsl",
    varyings=SURFACE_VARYINGS,
    outputs={"out_position_area": "VEC4", "out_normal": "VEC4", "out_flux": "VEC4", "out_specular": "VEC4"},
    samplers={**SURFACE_SAMPLERS, "face_tx": "FLOAT_2D"},
    uniforms={"reflected_light": LIGHT},
    structs=(INSTANCE, MATERIAL, MAP_FACE),
    constants={
        "pc_clip_from_world": "MAT4",
        "pc_first_chunk": "INT",
        "pc_perspective": "INT",
        "pc_far": "FLOAT",
        "pc_texel_measure": "FLOAT",  # see reflective_draw_frag.glsl
        "pc_served": "INT",
        "pc_dither": "INT",
    },
    defines=(*SURFACE_DEFINES, *LIGHT_DEFINES, *MAP_DEFINES, *SOURCE_DEFINES, ("MATERIAL_CAMERA_RAY", "0")),
    depth_write=True,
)
