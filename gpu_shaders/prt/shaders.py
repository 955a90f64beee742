"""Declarations of the passes that draw what baked objects pass on."""

from ...device.shader import Shader
from ...device.structs import Struct

# A cell of the table of lobes: roughness along x, root of 1 - cosine of the view along y, both 0..1. In its texels are
# the weights of each direction in the plane of the view, one for each band but the first, whose weight is 1 in all.
LOBES_SIDE = 32
LOBE_BANDS = 6
LOBE_TEXELS = -(-LOBE_BANDS * (LOBE_BANDS - 1) // 4)

PRT_DRAW = Struct(
    "PrtDraw",
    clip_from_world="mat4",
    world_from_object="mat4",
    local_from_world="mat4",  # rotation to the axes that the bake is kept in
    eye="vec4",  # FrameInputs.eye
    has="int",  # what the pixels' position.w says (frame.inputs.HAS_DEFINES)
    row="int",  # vertices in a row of the texture
    texels="int",  # of a vertex
    coefficients="int",  # of the arriving radiance
)

_GLOSSY = (
    ("GLOSSY", "1"),
    ("PRT_LOBES", str(LOBES_SIDE)),
    ("PRT_BANDS", str(LOBE_BANDS)),
    ("PRT_TEXELS", str(LOBE_TEXELS)),
)


def _draw(glossy: bool) -> Shader:
    varyings = {"v_position": "VEC3"}
    varyings |= {"v_weights": "VEC3", "v_triangle": "flat IVEC4"} if glossy else {"v_light": "VEC3"}
    return Shader(
        name="prt_draw_glossy" if glossy else "prt_draw",
        vertex="prt/prt_draw_vert.glsl",
        fragment=f"prt/prt_{'glossy' if glossy else 'diffuse'}_frag.glsl",
        inputs={"in_position": "VEC3", "in_triangle": "IVEC3"},
        varyings=varyings,
        outputs={"out_position": "VEC4", "out_diffuse": "VEC4", "out_glossy": "VEC4"},
        samplers={
            "light_tx": "FLOAT_2D",
            **({"normal_tx": "FLOAT_2D", "specular_tx": "FLOAT_2D", "lobe_tx": "FLOAT_2D"} if glossy else {}),
        },
        uniforms={"prt_draw": PRT_DRAW},
        defines=_GLOSSY if glossy else (),
    )


# By whether the bake has what arrives from every direction.
DRAW = {glossy: _draw(glossy) for glossy in (False, True)}

SHADERS = tuple(DRAW.values())
