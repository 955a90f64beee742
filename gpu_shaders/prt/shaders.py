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

# Texels in a row of a texture of vertices, or of the cuts inside triangles (bake/refine.py).
ROW_TEXELS = 2048
# How often a pixel goes on to a half of its triangle: more than any is cut.
DEEPEST = 64


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
    least_roughness="float",  # Look.HARMONICS: of bake.view_table.least_roughness
)

_DEFINES = {
    Look.MATT: (),
    Look.HARMONICS: (
        ("PRT_LOBES", str(LOBES_SIDE)),
        ("PRT_BANDS", str(LOBE_BANDS)),
        ("PRT_TEXELS", str(LOBE_TEXELS)),
    ),
    Look.LOBE: (("PRT_VIEWS", str(VIEWS)),),
}


def _draw(look: Look, refined: bool) -> Shader:
    """``refined``: with points inside triangles."""
    mirrors = look is not Look.MATT
    mixed = mirrors or refined
    varyings = {"v_position": "VEC3"}
    varyings |= {"v_weights": "VEC3", "v_triangle": "flat IVEC4"} if mixed else {"v_light": "VEC3"}
    defines = (("MIXED", "1"),) * mixed
    if refined:
        defines += (("REFINED", "1"), ("PRT_ROW", str(ROW_TEXELS)), ("PRT_DEEPEST", str(DEEPEST)))
    return Shader(
        name=f"prt_draw_{look.value}{'_refined' * refined}",
        vertex="prt/prt_draw_vert.glsl",
        fragment=f"prt/prt_{look.value}_frag.glsl",
        inputs={"in_position": "VEC3", "in_triangle": "IVEC3"},
        varyings=varyings,
        outputs={"out_position": "VEC4", "out_diffuse": "VEC4", "out_glossy": "VEC4"},
        samplers={
            "light_tx": "FLOAT_2D",
            **({"normal_tx": "FLOAT_2D", "specular_tx": "FLOAT_2D", "lobe_tx": "FLOAT_2D"} if mirrors else {}),
            **({"tree_tx": "FLOAT_2D"} if refined else {}),
        },
        uniforms={"prt_draw": PRT_DRAW},
        defines=(*defines, *_DEFINES[look]),
    )


# By what the bake has, and whether some of it is inside triangles.
DRAW = {(look, refined): _draw(look, refined) for look in Look for refined in (False, True)}

SHADERS = tuple(DRAW.values())
