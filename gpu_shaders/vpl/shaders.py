"""Declarations of the passes of virtual point lights."""

from ...device.shader import Shader
from ..frame.inputs import HAS_DEFINES
from ..frame.reflective_shaders import SOURCE_DEFINES
from ..frame.structs import LIGHT, LIGHT_DEFINES, MAP_DEFINES, MAP_FACE
from ..frame.voxels import VOXEL_GRID, VOXEL_SAMPLERS
from .structs import OLD_VIEW, PYRAMID_STEP, TILE, VPL_FRAME

# Entries of the pool in one row of its textures.
POOL_ROW = 64
# Cells of the cache's index along a side.
INDEX_CELLS = 32
_INDEX = (("VPL_INDEX", str(INDEX_CELLS)),)
_DEFINES = (*SOURCE_DEFINES, *_INDEX, ("VPL_POOL_ROW", str(POOL_ROW)), ("PYRAMID_STEP", str(PYRAMID_STEP)))

SKY = Shader(
    name="vpl_sky",
    fragment="vpl/vpl_sky_frag.glsl",
    outputs={"out_position_area": "VEC4", "out_normal": "VEC4", "out_flux": "VEC4", "out_specular": "VEC4"},
    samplers={"environment_tx": "FLOAT_2D"},
    constants={"pc_sphere": "VEC4", "pc_diffuse": "FLOAT", "pc_counts": "FLOAT", "pc_viewport": "VEC4"},
    defines=_DEFINES,
)

BLOCK_STRENGTH = Shader(
    name="vpl_block_strength",
    fragment="vpl/vpl_block_strength_frag.glsl",
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

TILE_STRENGTH = Shader(
    name="vpl_tile_strength",
    fragment="vpl/vpl_tile_strength_frag.glsl",
    outputs={"out_sum": "VEC4"},
    samplers={"level_tx": "FLOAT_2D", "tile_tx": "FLOAT_2D"},
    structs=(TILE,),
    constants={"pc_tile": "INT", "pc_blocks": "INT"},
)

TILES = Shader(
    name="vpl_tiles",
    fragment="vpl/vpl_tiles_frag.glsl",
    outputs={"out_tile": "VEC4"},
    samplers={"strength_tx": "FLOAT_2D", "tile_tx": "FLOAT_2D"},
    structs=(TILE,),
    constants={"pc_tiles": "INT", "pc_light_tiles": "INT"},
)

# The atlas, as every pass behind it reads it.
ATLAS_SAMPLERS = {
    "position_area_tx": "FLOAT_2D",
    "normal_kind_tx": "FLOAT_2D",
    "flux_tx": "FLOAT_2D",
    "specular_tx": "FLOAT_2D",
}

POOL = Shader(
    name="vpl_pool",
    fragment="vpl/vpl_pool_frag.glsl",
    outputs={"out_position": "VEC4", "out_normal": "VEC4", "out_flux": "VEC4", "out_specular": "VEC4"},
    samplers={
        **ATLAS_SAMPLERS,
        "fine_tx": "FLOAT_2D",
        "middle_tx": "FLOAT_2D",
        "coarse_tx": "FLOAT_2D",
        "sums_tx": "FLOAT_2D",
        "tile_tx": "FLOAT_2D",
    },
    structs=(TILE,),
    constants={
        "pc_count": "INT",
        "pc_number": "INT",
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
    "pool_specular_tx": "FLOAT_2D",
    "sums_tx": "FLOAT_2D",
    "tile_tx": "FLOAT_2D",
    "light_tx": "FLOAT_2D",
    "face_tx": "FLOAT_2D",
    "cache_index_tx": "FLOAT_2D",
    "emitter_index_tx": "FLOAT_2D",
    "cache_sky_tx": "FLOAT_2D",
    **VOXEL_SAMPLERS,
}


def _candidate_pass(
    name: str,
    fragment: str,
    outputs: tuple[str, ...],
    samplers: tuple[str, ...],
    constants: dict[str, str],
    defines: tuple[tuple[str, str], ...],
) -> Shader:
    """A pass that includes vpl_candidates_lib.glsl."""
    return Shader(
        name=name,
        fragment=fragment,
        outputs={output: "VEC4" for output in outputs},
        samplers={**{sampler: "FLOAT_2D" for sampler in samplers}, **_CANDIDATES},
        uniforms={"voxel_grid": VOXEL_GRID, "vpl_frame": VPL_FRAME},
        structs=(TILE, LIGHT, MAP_FACE),
        constants=constants,
        defines=(*_DEFINES, *LIGHT_DEFINES, *MAP_DEFINES, *HAS_DEFINES, *defines),
    )


_COARSE = {"pc_stride": "INT", "pc_offset": "IVEC2"}


_GLOSSY, _REUSE, _FIRST_HAND = ("GLOSSY", "1"), ("REUSE", "1"), ("FIRST_HAND", "1")
_SWITCHES = (False, True)


def _with_defines(name: str, glossy: bool, first_hand: bool) -> tuple[str, tuple[tuple[str, str], ...]]:
    """Name and defines of a variant."""
    chosen = [("_glossy", _GLOSSY)] * glossy + [("_first_hand", _FIRST_HAND)] * first_hand
    return name + "".join(suffix for suffix, _ in chosen), tuple(define for _, define in chosen)


def _gather(name: str, *defines: tuple[str, str]) -> Shader:
    outputs, samplers = ("out_surface", "out_indirect", "out_direct"), ("position_tx", "normal_tx")
    if _REUSE in defines and _FIRST_HAND in defines:
        outputs = (*outputs, "out_emitted")
    return _candidate_pass(name, "vpl/vpl_gather_frag.glsl", outputs, samplers, _COARSE, defines)


def _gather_to_reuse(glossy: bool, first_hand: bool) -> Shader:
    name, defines = _with_defines("vpl_gather_to_reuse", glossy, first_hand)
    return _gather(name, _REUSE, *defines, *(() if first_hand else (("LAMPS_ONLY", "1"),)))


# By whether anything in the scene is glossy.
GATHER = {False: _gather("vpl_gather"), True: _gather("vpl_gather_glossy", _GLOSSY)}
# For the reuse, by that and by whether emitters or the sky give light, which is direct light and kept apart.
GATHER_TO_REUSE = {(glossy, first): _gather_to_reuse(glossy, first) for glossy in _SWITCHES for first in _SWITCHES}

VIEW_BOUND = _gather("vpl_view_bound", ("BOUND_VIEW", "1"))
VIEW_VOXELS = Shader(
    name="vpl_view_voxels",
    fragment="vpl/vpl_view_voxels_frag.glsl",
    outputs={"out_color": "VEC4"},
    samplers=VOXEL_SAMPLERS,
    uniforms={"voxel_grid": VOXEL_GRID},
    constants={"pc_world_from_clip": "MAT4"},
)
VIEW_HISTORY = Shader(
    name="vpl_view_history",
    fragment="vpl/vpl_view_history_frag.glsl",
    outputs={"out_color": "VEC4"},
    samplers={"history_tx": "FLOAT_2D"},
    constants={"pc_stride": "INT", "pc_many": "FLOAT"},
)

VIEW_RESOLUTION = Shader(
    name="vpl_view_resolution",
    fragment="vpl/vpl_view_resolution_frag.glsl",
    outputs={"out_color": "VEC4"},
    samplers={"position_tx": "FLOAT_2D", "normal_tx": "FLOAT_2D", "surface_tx": "FLOAT_2D"},
    constants={"pc_stride": "INT", "pc_offset": "IVEC2"},
)
VIEW_OCCLUSION = Shader(
    name="vpl_view_occlusion",
    fragment="vpl/vpl_view_occlusion_frag.glsl",
    outputs={"out_color": "VEC4"},
    samplers={"position_tx": "FLOAT_2D", "normal_tx": "FLOAT_2D", **VOXEL_SAMPLERS},
    uniforms={"voxel_grid": VOXEL_GRID},
    constants={"pc_eye": "VEC4", "pc_reach": "FLOAT", "pc_sample": "INT", "pc_seed": "INT"},
)
VIEW_POOL = Shader(
    name="vpl_view_pool",
    vertex="vpl/vpl_view_pool_vert.glsl",
    fragment="vpl/vpl_view_pool_frag.glsl",
    varyings={"v_position": "VEC3", "v_color": "VEC3"},
    outputs={"out_color": "VEC4"},
    samplers={
        "position_tx": "FLOAT_2D",
        **{f"pool_{name}_tx": "FLOAT_2D" for name in ("position", "normal", "flux", "specular")},
        "sums_tx": "FLOAT_2D",
    },
    constants={"pc_clip_from_world": "MAT4", "pc_eye": "VEC4", "pc_pixel": "VEC2", "pc_tiles": "INT"},
    defines=_DEFINES,
)

REFLECT = _candidate_pass(
    "vpl_reflect",
    "vpl/vpl_reflect_frag.glsl",
    ("out_surface", "out_indirect", "out_direct"),
    ("position_tx", "normal_tx", "specular_color_tx", "environment_tx"),
    _COARSE,
    (_GLOSSY,),
)

REFLECT_MEAN = Shader(
    name="vpl_reflect_mean",
    fragment="vpl/vpl_reflect_mean_frag.glsl",
    outputs={"out_history": "VEC4", "out_noisy": "VEC4", "out_direct": "VEC4"},
    samplers={
        name: "FLOAT_2D"
        for name in ("surface_tx", "indirect_tx", "direct_tx", "old_surface_tx", "history_tx", "direct_history_tx")
    },
    uniforms={"old_view": OLD_VIEW},
    constants={
        "pc_most_history": "FLOAT",  # samples that the mean before may stand for
        "pc_still": "INT",  # 1: the view is that of the picture before
    },
)


def _reuse(glossy: bool, first_hand: bool) -> Shader:
    name, defines = _with_defines("vpl_reuse", glossy, first_hand)
    direct = ("emitted_tx", "direct_history_tx") if first_hand else ()
    return Shader(
        name=name,
        fragment="vpl/vpl_reuse_frag.glsl",
        outputs={
            "out_reservoir": "VEC4",
            "out_history": "VEC4",
            "out_noisy": "VEC4",
            **({"out_direct": "VEC4"} if first_hand else {}),
        },
        samplers={
            **ATLAS_SAMPLERS,
            **VOXEL_SAMPLERS,
            "position_tx": "FLOAT_2D",
            "surface_tx": "FLOAT_2D",
            "reservoir_tx": "FLOAT_2D",
            "rest_tx": "FLOAT_2D",
            "old_surface_tx": "FLOAT_2D",
            "old_reservoir_tx": "FLOAT_2D",
            "history_tx": "FLOAT_2D",
            **{name: "FLOAT_2D" for name in direct},
        },
        uniforms={"voxel_grid": VOXEL_GRID, "vpl_frame": VPL_FRAME, "old_view": OLD_VIEW},
        constants={
            "pc_most_reuse": "FLOAT",  # samples that an old reservoir may stand for
            "pc_most_history": "FLOAT",  # samples that the mean before may stand for
        },
        defines=(*_DEFINES, *defines),
    )


# As GATHER_TO_REUSE.
REUSE = {(glossy, first): _reuse(glossy, first) for glossy in _SWITCHES for first in _SWITCHES}


def _atrous(first_hand: bool) -> Shader:
    name, defines = _with_defines("vpl_atrous", False, first_hand)
    return Shader(
        name=name,
        fragment="vpl/vpl_atrous_frag.glsl",
        outputs={"out_light": "VEC4", **({"out_direct": "VEC4"} if first_hand else {})},
        samplers={
            "surface_tx": "FLOAT_2D",
            "light_tx": "FLOAT_2D",
            **({"direct_tx": "FLOAT_2D"} if first_hand else {}),
        },
        constants={"pc_step": "INT"},
        defines=defines,
    )


# By whether direct light is kept apart.
ATROUS = {first: _atrous(first) for first in _SWITCHES}


def _upsample(glossy: bool) -> Shader:
    name, defines = _with_defines("vpl_upsample", glossy, False)
    textures = ("position_tx", "normal_tx", "surface_tx", "light_tx", *(("specular_color_tx",) if glossy else ()))
    return Shader(
        name=name,
        fragment="vpl/vpl_upsample_frag.glsl",
        outputs={"out_light": "VEC4"},
        samplers={texture: "FLOAT_2D" for texture in textures},
        constants={
            "pc_stride": "FLOAT",
            "pc_offset": "VEC2",
            "pc_gain": "FLOAT",
            **({"pc_eye": "VEC4"} if glossy else {}),
        },
        defines=defines,
    )


# By whether it is light over a lobe's albedo.
UPSAMPLE = {glossy: _upsample(glossy) for glossy in _SWITCHES}

INDEX_SCATTER = Shader(
    name="vpl_index_scatter",
    vertex="vpl/vpl_index_scatter_vert.glsl",
    fragment="vpl/vpl_index_scatter_frag.glsl",
    varyings={"v_point": "flat VEC4"},
    outputs={"out_point": "VEC4"},
    samplers={"position_area_tx": "FLOAT_2D", "normal_kind_tx": "FLOAT_2D", "flux_tx": "FLOAT_2D"},
    constants={"pc_index": "VEC4", "pc_origin": "IVEC2", "pc_side": "INT"},
    defines=_INDEX,
)

COVER_SCATTER = Shader(
    name="vpl_cover_scatter",
    vertex="vpl/vpl_cover_scatter_vert.glsl",
    fragment="vpl/vpl_cover_scatter_frag.glsl",
    varyings={"v_area": "flat VEC4"},
    outputs={"out_area": "VEC4"},
    samplers={"position_area_tx": "FLOAT_2D", "normal_kind_tx": "FLOAT_2D"},
    constants={"pc_index": "VEC4", "pc_origin": "IVEC2", "pc_side": "INT", "pc_level": "INT", "pc_voxel": "FLOAT"},
    defines=_INDEX,
)

INDEX_SPREAD = Shader(
    name="vpl_index_spread",
    fragment="vpl/vpl_index_spread_frag.glsl",
    outputs={"out_point": "VEC4"},
    samplers={"index_tx": "FLOAT_2D"},
    constants={"pc_level": "INT"},
    defines=_INDEX,
)

CACHE_FADE = Shader(
    name="vpl_cache_fade",
    fragment="vpl/vpl_cache_fade_frag.glsl",
    outputs={"out_sum": "VEC4", "out_sky": "VEC4"},
    samplers={"sum_tx": "FLOAT_2D", "sky_tx": "FLOAT_2D"},
    constants={"pc_most": "FLOAT", "pc_rows": "IVEC2"},
)


def _cache_gather(name: str, *defines: tuple[str, str]) -> Shader:
    constants = {"pc_rounds": "INT", "pc_origin": "IVEC2"}
    return _candidate_pass(
        name, "vpl/vpl_cache_gather_frag.glsl", ("out_sum", "out_sky"), ("position_tx",), constants, defines
    )


CACHE_GATHER = {False: _cache_gather("vpl_cache_gather"), True: _cache_gather("vpl_cache_gather_glossy", _GLOSSY)}

CACHE_EMIT = Shader(
    name="vpl_cache_emit",
    fragment="vpl/vpl_cache_emit_frag.glsl",
    outputs={"out_flux": "VEC4"},
    samplers={"sum_tx": "FLOAT_2D", "position_area_tx": "FLOAT_2D", "reflectance_tx": "FLOAT_2D"},
    constants={"pc_origin": "IVEC2"},
)

SHADERS = (
    INDEX_SCATTER,
    COVER_SCATTER,
    INDEX_SPREAD,
    CACHE_FADE,
    *CACHE_GATHER.values(),
    CACHE_EMIT,
    SKY,
    BLOCK_STRENGTH,
    REDUCE,
    TILE_STRENGTH,
    TILES,
    POOL,
    *GATHER.values(),
    *GATHER_TO_REUSE.values(),
    VIEW_BOUND,
    VIEW_VOXELS,
    VIEW_HISTORY,
    VIEW_RESOLUTION,
    VIEW_OCCLUSION,
    VIEW_POOL,
    REFLECT,
    REFLECT_MEAN,
    *REUSE.values(),
    *ATROUS.values(),
    *UPSAMPLE.values(),
)
