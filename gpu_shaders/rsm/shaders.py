"""Declarations of the passes of reflective shadow maps."""

from ...device.shader import Shader
from ..frame.structs import LIGHT, LIGHT_DEFINES, MAP_DEFINES, MAP_FACE

_GATHER = {
    "position_tx": "FLOAT_2D",
    "normal_tx": "FLOAT_2D",
    "reused_tx": "FLOAT_2D",
    "rsm_position_tx": "FLOAT_2D",
    "rsm_normal_tx": "FLOAT_2D",
    "rsm_flux_tx": "FLOAT_2D",
}
_GRID = {"pc_stride": "INT", "pc_offset": "IVEC2"}

GATHER_ALL = Shader(
    name="rsm_gather_all",
    fragment="rsm/rsm_gather_all_frag.glsl",
    outputs={"out_indirect": "VEC4"},
    samplers=_GATHER,
    constants={**_GRID, "pc_first_row": "INT", "pc_last_row": "INT", "pc_row_length": "INT"},
)


def _gather_disc(name: str, defines: tuple[tuple[str, str], ...]) -> Shader:
    return Shader(
        name=name,
        fragment="rsm/rsm_gather_disc_frag.glsl",
        outputs={"out_indirect": "VEC4"},
        samplers={**_GATHER, "light_tx": "FLOAT_2D", "rsm_face_tx": "FLOAT_2D"},
        structs=(LIGHT, MAP_FACE),
        constants={
            **_GRID,
            "pc_first_light": "INT",
            "pc_last_light": "INT",
            "pc_gathers": "INT",  # of a light in this sample; this pass takes those from pc_first_gather on
            "pc_first_gather": "INT",
            "pc_last_gather": "INT",
            "pc_radius": "FLOAT",
            "pc_seed": "INT",
            "pc_sample": "INT",
        },
        defines=(*LIGHT_DEFINES, *MAP_DEFINES, *defines),
    )


GATHER_PUBLISHED = _gather_disc("rsm_gather_disc_published", (("PUBLISHED", "1"),))
GATHER_EXACT = _gather_disc("rsm_gather_disc_exact", ())

INTERPOLATE = Shader(
    name="rsm_interpolate",
    fragment="rsm/rsm_interpolate_frag.glsl",
    outputs={"out_indirect": "VEC4", "out_reused": "VEC4"},
    samplers={"position_tx": "FLOAT_2D", "normal_tx": "FLOAT_2D", "coarse_tx": "FLOAT_2D"},
    constants=_GRID,
)

VIEW_RESOLUTION = Shader(
    name="rsm_view_resolution",
    fragment="rsm/rsm_view_resolution_frag.glsl",
    outputs={"out_color": "VEC4"},
    samplers={"position_tx": "FLOAT_2D", "reused_tx": "FLOAT_2D"},
    constants={"pc_interpolates": "INT"},
)

SHADERS = (GATHER_ALL, GATHER_PUBLISHED, GATHER_EXACT, INTERPOLATE, VIEW_RESOLUTION)
