"""Declarations of the passes of virtual point lights."""

from ...device.shader import Shader
from ..frame.structs import LIGHT, LIGHT_DEFINES, MAP_DEFINES, MAP_FACE
from ..frame.voxels import VOXEL_GRID, VOXEL_SAMPLERS
from .structs import KIND_DEFINES, PYRAMID_STEP, TILE

# Entries of the pool in one row of its textures.
POOL_ROW = 64
_DEFINES = (*KIND_DEFINES, ("VPL_POOL_ROW", str(POOL_ROW)), ("PYRAMID_STEP", str(PYRAMID_STEP)))

SKY = Shader(
    name="vpl_sky",
    fragment="vpl/vpl_sky_frag.glsl",
    outputs={"out_position_area": "VEC4", "out_normal": "VEC4", "out_flux": "VEC4", "out_specular": "VEC4"},
    constants={"pc_sphere": "VEC4", "pc_radiance": "VEC3", "pc_viewport": "VEC4"},
    defines=_DEFINES,
)

LUMINANCE = Shader(
    name="vpl_luminance",
    fragment="vpl/vpl_luminance_frag.glsl",
    outputs={"out_sum": "VEC4"},
    samplers={"flux_tx": "FLOAT_2D", "specular_tx": "FLOAT_2D"},
    defines=_DEFINES,
)

REDUCE = Shader(
    name="vpl_reduce",
    fragment="vpl/vpl_reduce_frag.glsl",
    outputs={"out_sum": "VEC4"},
    samplers={"level_tx": "FLOAT_2D"},
    constants={"pc_children": "INT", "pc_parents": "INT"},
    defines=_DEFINES,
)

TILES = Shader(
    name="vpl_tiles",
    fragment="vpl/vpl_tiles_frag.glsl",
    outputs={"out_tile": "VEC4"},
    samplers={"level_tx": "FLOAT_2D", "tile_tx": "FLOAT_2D"},
    structs=(TILE,),
    constants={"pc_tile": "INT", "pc_blocks": "INT", "pc_light_tiles": "INT"},
)

# The atlas, as every pass behind it reads it.
ATLAS_SAMPLERS = {"position_area_tx": "FLOAT_2D", "normal_kind_tx": "FLOAT_2D", "flux_tx": "FLOAT_2D"}

POOL = Shader(
    name="vpl_pool",
    fragment="vpl/vpl_pool_frag.glsl",
    outputs={"out_position": "VEC4", "out_normal": "VEC4", "out_flux": "VEC4"},
    samplers={
        **ATLAS_SAMPLERS,
        "specular_tx": "FLOAT_2D",
        "fine_tx": "FLOAT_2D",
        "middle_tx": "FLOAT_2D",
        "coarse_tx": "FLOAT_2D",
        "sums_tx": "FLOAT_2D",
        "tile_tx": "FLOAT_2D",
    },
    structs=(TILE,),
    constants={
        "pc_count": "INT",
        "pc_seed": "INT",
        "pc_tiles": "INT",
        "pc_light_tiles": "INT",
        "pc_tile": "INT",
        "pc_coarse": "INT",
    },
    defines=_DEFINES,
)

# What vpl_candidates_lib.glsl reads.
_CANDIDATES = {
    **ATLAS_SAMPLERS,
    "pool_position_tx": "FLOAT_2D",
    "pool_normal_tx": "FLOAT_2D",
    "pool_flux_tx": "FLOAT_2D",
    "sums_tx": "FLOAT_2D",
    "tile_tx": "FLOAT_2D",
    "light_tx": "FLOAT_2D",
    "face_tx": "FLOAT_2D",
    **VOXEL_SAMPLERS,
}
_CANDIDATE_CONSTANTS = {
    "pc_sky": "VEC4",
    "pc_sample": "INT",
    "pc_seed": "INT",
    "pc_pool": "INT",
    "pc_tiles": "INT",
    "pc_light_tiles": "INT",
    "pc_candidates": "INT",
    "pc_occluded": "INT",
}

GATHER = Shader(
    name="vpl_gather",
    fragment="vpl/vpl_gather_frag.glsl",
    outputs={"out_indirect": "VEC4", "out_direct": "VEC4"},
    samplers={"position_tx": "FLOAT_2D", "normal_tx": "FLOAT_2D", **_CANDIDATES},
    uniforms={"voxel_grid": VOXEL_GRID},
    structs=(TILE, LIGHT, MAP_FACE),
    constants={**_CANDIDATE_CONSTANTS, "pc_stride": "INT", "pc_offset": "IVEC2"},
    defines=(*_DEFINES, *LIGHT_DEFINES, *MAP_DEFINES),
)

UPSAMPLE = Shader(
    name="vpl_upsample",
    fragment="vpl/vpl_upsample_frag.glsl",
    outputs={"out_light": "VEC4"},
    samplers={"position_tx": "FLOAT_2D", "normal_tx": "FLOAT_2D", "coarse_tx": "FLOAT_2D"},
    constants={"pc_stride": "INT", "pc_offset": "IVEC2"},
)

SHADERS = (SKY, LUMINANCE, REDUCE, TILES, POOL, GATHER, UPSAMPLE)
