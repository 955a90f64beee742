"""Declarations of the passes that every frame has."""

from collections.abc import Sequence

from ...device.shader import Shader
from ...scene.data import LightKind
from .structs import (
    INSTANCE,
    LIGHT,
    LIGHT_DEFINES,
    MAP_DEFINES,
    MAP_FACE,
    MATERIAL,
    MESH_DEFINES,
    VISIBILITY_DEFINES,
)

# What a picture can keep a sum of.
SUMS = (
    "combined",
    "diffuse_direct",
    "diffuse_indirect",
    "diffuse_color",
    "emission",
    "environment",
    "glossy_direct",
    "glossy_indirect",
    "glossy_color",
    "transmission_direct",
    "transmission_indirect",
    "transmission_color",
)

# What passes that draw meshes are given beside their own (batches.py), and those that ask for materials.
MESH_SAMPLERS = {"chunk_tx": "FLOAT_2D", "corner_tx": "FLOAT_2D", "instance_tx": "FLOAT_2D"}
SURFACE_SAMPLERS = {**MESH_SAMPLERS, "material_tx": "FLOAT_2D"}
# v_drawn: rows of instance and material, first value of its graph, visibility.
SURFACE_VARYINGS = {"v_position": "VEC3", "v_normal": "VEC3", "v_drawn": "flat IVEC4"}
SURFACE_DEFINES = (
    *MESH_DEFINES,
    *VISIBILITY_DEFINES,
    ("MATERIAL_INDEX", "v_drawn.y"),
    ("MATERIAL_VALUES", "v_drawn.z"),
)

GBUFFER = Shader(
    name="frame_gbuffer",
    vertex="frame/frame_draw_vert.glsl",
    fragment="frame/frame_gbuffer_frag.glsl",
    varyings=SURFACE_VARYINGS,
    outputs={
        "out_albedo": "VEC4",
        "out_emission": "VEC4",
        "out_position": "VEC4",
        "out_normal": "VEC4",
        "out_specular": "VEC4",
    },
    samplers=SURFACE_SAMPLERS,
    structs=(INSTANCE, MATERIAL),
    constants={
        "pc_clip_from_world": "MAT4",
        "pc_eye": "VEC4",  # camera position and 1, or for an orthographic view the direction to it and 0
        "pc_first_chunk": "INT",
        "pc_dither": "INT",
    },
    defines=(*SURFACE_DEFINES, ("MATERIAL_CAMERA_RAY", "1")),
)

# The colour of what was passed on the way to the surface that is seen.
TINT = Shader(
    name="frame_tint",
    vertex="frame/frame_draw_vert.glsl",
    fragment="frame/frame_tint_frag.glsl",
    varyings=SURFACE_VARYINGS,
    outputs={"out_albedo": "VEC4", "out_emission": "VEC4", "out_specular": "VEC4", "out_passed": "VEC4"},
    samplers=SURFACE_SAMPLERS,
    structs=(INSTANCE, MATERIAL),
    constants={
        "pc_clip_from_world": "MAT4",
        "pc_eye": "VEC4",
        "pc_first_chunk": "INT",
    },
    defines=(*SURFACE_DEFINES, ("MATERIAL_CAMERA_RAY", "1")),
)

_SHADOW_CONSTANTS = {
    "pc_clip_from_world": "MAT4",
    "pc_first_chunk": "INT",
    "pc_perspective": "INT",
    "pc_far": "FLOAT",
    "pc_tile": "FLOAT",
}

SHADOW = Shader(
    name="shadow_draw",
    vertex="frame/shadow_draw_vert.glsl",
    fragment="frame/shadow_draw_frag.glsl",
    varyings={"v_depth": "FLOAT"},
    outputs={"out_slope": "VEC4"},
    samplers=MESH_SAMPLERS,
    structs=(INSTANCE, MAP_FACE),
    constants=_SHADOW_CONSTANTS,
    defines=(*MESH_DEFINES, *MAP_DEFINES),
    depth_write=True,
)

# Of materials that let light pass.
SHADOW_PASSING = Shader(
    name="shadow_passing",
    vertex="frame/frame_draw_vert.glsl",
    fragment="frame/shadow_passing_frag.glsl",
    varyings={**SURFACE_VARYINGS, "v_depth": "FLOAT"},
    outputs={"out_slope": "VEC4"},
    samplers=SURFACE_SAMPLERS,
    structs=(INSTANCE, MATERIAL, MAP_FACE),
    constants={**_SHADOW_CONSTANTS, "pc_eye": "VEC4", "pc_dither": "INT"},
    defines=(*SURFACE_DEFINES, *MAP_DEFINES, ("MATERIAL_CAMERA_RAY", "0"), ("MAP_DEPTH", "1")),
    depth_write=True,
)


def _direct(kind: LightKind, filtered: bool, one_face: bool, glossy: bool) -> Shader:
    """Direct light of one light of a kind: ``filtered`` shadows or not, one shadow map face or any number of them."""
    words = [
        "frame_direct",
        kind.name.lower(),
        *(["filtered"] if filtered else []),
        *(["one_face"] if one_face else []),
    ]
    defines = [("LIGHT_KIND", f"LIGHT_{kind.name}"), ("LIGHT_FILTERED", str(int(filtered)))]
    defines += [("LIGHT_ONE_FACE", "1")] if one_face else []
    defines += [("GLOSSY", "1")] if glossy else []
    return Shader(
        name="_".join([*words, *(["glossy"] if glossy else [])]),
        fragment="frame/frame_direct_frag.glsl",
        outputs={"out_diffuse": "VEC4", **({"out_glossy": "VEC4"} if glossy else {})},
        samplers={
            "position_tx": "FLOAT_2D",
            "normal_tx": "FLOAT_2D",
            **({"specular_tx": "FLOAT_2D"} if glossy else {}),
            **({} if one_face else {"face_tx": "FLOAT_2D"}),
            "shadow_depth_tx": "FLOAT_2D",
            "shadow_slope_tx": "FLOAT_2D",
        },
        uniforms={"direct_light": LIGHT, **({"direct_face": MAP_FACE} if one_face else {})},
        structs=(MAP_FACE,),
        constants={
            **({"pc_eye": "VEC4"} if glossy else {}),
            "pc_seed": "INT",
            "pc_sample": "INT",
        },
        defines=(*LIGHT_DEFINES, *MAP_DEFINES, *defines),
    )


# By (kind, filtered, one face, glossy). One program for all would run through what every kind needs, for every light;
# and a light in a uniform block costs a pixel nothing to fetch.
DIRECT = {
    (kind, filtered, one_face, glossy): _direct(kind, filtered, one_face, glossy)
    for kind in LightKind
    for filtered in (False, True)
    for one_face in ((False, True) if kind in (LightKind.SPOT, LightKind.SUN) else (False,))
    for glossy in (False, True)
}


def accumulate(
    sums: Sequence[str], *, glossy: bool, indirect: bool, panorama: bool = False, passed: bool = False
) -> Shader:
    """Add a sample to up to six ``sums``: of SUMS, or "moments" (luminance, its square).

    Without ``glossy`` or ``indirect`` that light is taken for none. ``panorama``: the background is more than one
    colour, and stands in the G-buffer's emission. ``passed``: some of it all may be seen through glass.
    """
    passed = passed and not {*sums} <= {"combined", "moments"}
    light = ["diffuse_direct", *(["diffuse_indirect"] if indirect else [])]
    light += ["glossy_direct", *(["glossy_indirect"] if indirect else [])] if glossy else []
    albedo = glossy and "glossy_color" in sums
    samplers = ["albedo", "emission", *light, *(["position", "normal", "specular"] if albedo else [])]
    samplers += ["passed"] if passed else []
    defines = [f"WANT_{name.upper()}" for name in sums]
    kinds = {"GLOSSY": glossy, "INDIRECT": indirect, "PANORAMA": panorama, "PASSED": passed}
    defines += [name for name, wanted in kinds.items() if wanted]
    return Shader(
        name="_".join(["frame_accumulate", *(d.lower() for d in defines if "_" not in d), sums[0], str(len(sums))]),
        fragment="frame/frame_accumulate_frag.glsl",
        outputs={f"out_{name}": "VEC4" for name in sums},
        samplers={f"{name}_tx": "FLOAT_2D" for name in samplers},
        constants={"pc_background": "VEC4", **({"pc_eye": "VEC4"} if albedo else {})},
        defines=tuple((name, "1") for name in defines),
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

SPLIT = Shader(
    name="frame_split",
    fragment="frame/frame_split_frag.glsl",
    outputs={"out_color": "VEC4"},
    samplers={"image_tx": "FLOAT_2D", "without_tx": "FLOAT_2D"},
    constants={"pc_place": "FLOAT", "pc_weight": "FLOAT"},
)

# The accumulations of a viewport, and of a final render with all passes.
_ACCUMULATE = tuple(
    accumulate(sums, glossy=lit, indirect=lit, panorama=panorama, passed=panorama)
    for sums in (SUMS[:1], SUMS[:6], SUMS[6:], ("moments",))
    for lit, panorama in ((False, False), (True, False), (True, True))
)

SHADERS = (GBUFFER, TINT, SHADOW, SHADOW_PASSING, *DIRECT.values(), *_ACCUMULATE, GEOMETRY, RESOLVE, DISPLAY, SPLIT)
