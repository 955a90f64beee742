"""Declarations of the passes that draw what baked objects pass on."""

from enum import Enum

from ...device.shader import Shader
from ...device.structs import Struct

# A cell of the table of lobes: roughness along x, root of 1 - cosine of the view along y, both 0..1. In its texels are
# the weights of each direction in the plane of the view, one for each band but the first, whose weight is 1 in all.
LOBES_SIDE = 32
LOBE_BANDS = 6
LOBE_TEXELS = -(-LOBE_BANDS * (LOBE_BANDS - 1) // 4)

# Rows of the table of a lobe that is a sum of products (bake/separable.py).
VIEWS = 64


class Look(Enum):
    """What the numbers of a vertex are."""

    MATT = "matt"  # irradiance / pi
    HARMONICS = "harmonics"  # of the arriving radiance
    LOBE = "lobe"  # irradiance / pi, the numbers that a lobe's factors of the view weigh, normal and tangent


PRT_DRAW = Struct(
    "PrtDraw",
    clip_from_world="mat4",
    world_from_object="mat4",
    local_from_world="mat4",  # rotation to the axes that the bake is kept in
    eye="vec4",  # FrameInputs.eye
    has="int",  # what the pixels' position.w says (frame.inputs.HAS_DEFINES)
    row="int",  # vertices in a row of the texture
    texels="int",  # of a vertex
    coefficients="int",  # of one vertex
)

_DEFINES = {
    Look.MATT: (),
    Look.HARMONICS: (
        ("MIXED", "1"),
        ("PRT_LOBES", str(LOBES_SIDE)),
        ("PRT_BANDS", str(LOBE_BANDS)),
        ("PRT_TEXELS", str(LOBE_TEXELS)),
    ),
    Look.LOBE: (("MIXED", "1"), ("PRT_VIEWS", str(VIEWS))),
}


def _draw(look: Look) -> Shader:
    mixed = look is not Look.MATT
    varyings = {"v_position": "VEC3"}
    varyings |= {"v_weights": "VEC3", "v_triangle": "flat IVEC4"} if mixed else {"v_light": "VEC3"}
    return Shader(
        name=f"prt_draw_{look.value}",
        vertex="prt/prt_draw_vert.glsl",
        fragment=f"prt/prt_{look.value}_frag.glsl",
        inputs={"in_position": "VEC3", "in_triangle": "IVEC3"},
        varyings=varyings,
        outputs={"out_position": "VEC4", "out_diffuse": "VEC4", "out_glossy": "VEC4"},
        samplers={
            "light_tx": "FLOAT_2D",
            **({"normal_tx": "FLOAT_2D", "specular_tx": "FLOAT_2D", "lobe_tx": "FLOAT_2D"} if mixed else {}),
        },
        uniforms={"prt_draw": PRT_DRAW},
        defines=_DEFINES[look],
    )


# By what the bake has.
DRAW = {look: _draw(look) for look in Look}

SHADERS = tuple(DRAW.values())
