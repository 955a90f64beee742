"""Declarations of the passes that every frame has."""

from ...device.shader import Shader
from .structs import IMAGE_DEFINES, INSTANCE, LIGHT, LIGHT_DEFINES, MAP_DEFINES, MAP_FACE, MATERIAL

MESH_INPUTS = {"in_position": "VEC3", "in_normal": "VEC3", "in_base_uv": "VEC2", "in_emission_uv": "VEC2"}
MESH_VARYINGS = {"v_position": "VEC3", "v_normal": "VEC3", "v_base_uv": "VEC2", "v_emission_uv": "VEC2"}
MESH_SAMPLERS = {
    "instance_tx": "FLOAT_2D",
    "material_tx": "FLOAT_2D",
    "base_tx": "FLOAT_2D",
    "emission_tx": "FLOAT_2D",
}

GBUFFER = Shader(
    name="frame_gbuffer",
    vertex="frame/frame_draw_vert.glsl",
    fragment="frame/frame_gbuffer_frag.glsl",
    inputs=MESH_INPUTS,
    varyings=MESH_VARYINGS,
    outputs={
        "out_albedo": "VEC4",
        "out_emission": "VEC4",
        "out_position": "VEC4",
        "out_normal": "VEC4",
        "out_specular": "VEC4",
    },
    samplers=MESH_SAMPLERS,
    structs=(INSTANCE, MATERIAL),
    constants={
        "pc_clip_from_world": "MAT4",
        "pc_eye": "VEC4",  # camera position and 1, or for an orthographic view the direction to it and 0
        "pc_first_instance": "INT",
        "pc_material": "INT",
        "pc_holdout": "INT",
    },
    defines=IMAGE_DEFINES,
)

SHADOW = Shader(
    name="shadow_draw",
    vertex="frame/shadow_draw_vert.glsl",
    fragment="frame/shadow_draw_frag.glsl",
    inputs={"in_position": "VEC3"},
    varyings={"v_depth": "FLOAT"},
    outputs={"out_slope": "VEC4"},
    samplers={"instance_tx": "FLOAT_2D"},
    structs=(INSTANCE, MAP_FACE),
    constants={
        "pc_clip_from_world": "MAT4",
        "pc_first_instance": "INT",
        "pc_perspective": "INT",
        "pc_far": "FLOAT",
        "pc_tile": "FLOAT",
    },
    defines=MAP_DEFINES,
    depth_write=True,
)

DIRECT = Shader(
    name="frame_direct",
    fragment="frame/frame_direct_frag.glsl",
    outputs={"out_direct": "VEC4"},
    samplers={
        "position_tx": "FLOAT_2D",
        "normal_tx": "FLOAT_2D",
        "light_tx": "FLOAT_2D",
        "face_tx": "FLOAT_2D",
        "shadow_depth_tx": "FLOAT_2D",
        "shadow_slope_tx": "FLOAT_2D",
    },
    structs=(LIGHT, MAP_FACE),
    constants={"pc_first_light": "INT", "pc_last_light": "INT", "pc_seed": "INT", "pc_sample": "INT"},
    defines=(*LIGHT_DEFINES, *MAP_DEFINES),
)

ACCUMULATE = Shader(
    name="frame_accumulate",
    fragment="frame/frame_accumulate_frag.glsl",
    outputs={
        "out_combined": "VEC4",
        "out_diffuse_direct": "VEC4",
        "out_diffuse_indirect": "VEC4",
        "out_diffuse_color": "VEC4",
        "out_emission": "VEC4",
        "out_environment": "VEC4",
    },
    samplers={
        "albedo_tx": "FLOAT_2D",
        "emission_tx": "FLOAT_2D",
        "diffuse_direct_tx": "FLOAT_2D",
        "diffuse_indirect_tx": "FLOAT_2D",
        "glossy_direct_tx": "FLOAT_2D",
        "glossy_indirect_tx": "FLOAT_2D",
    },
    constants={"pc_background": "VEC4"},
)

GEOMETRY = Shader(
    name="frame_geometry",
    fragment="frame/frame_geometry_frag.glsl",
    outputs={"out_position_depth": "VEC4", "out_normal": "VEC4"},
    samplers={"position_tx": "FLOAT_2D", "normal_tx": "FLOAT_2D"},
    constants={"pc_view_from_world": "MAT4"},
)

RESOLVE = Shader(
    name="frame_resolve",
    fragment="frame/frame_resolve_frag.glsl",
    outputs={"out_color": "VEC4"},
    samplers={"sum_tx": "FLOAT_2D"},
    constants={"pc_weight": "FLOAT"},
)

DISPLAY = Shader(
    name="frame_display",
    fragment="frame/frame_display_frag.glsl",
    outputs={"out_color": "VEC4"},
    samplers={"image_tx": "FLOAT_2D"},
)

SHADERS = (GBUFFER, SHADOW, DIRECT, ACCUMULATE, GEOMETRY, RESOLVE, DISPLAY)
