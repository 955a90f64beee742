"""Tables of the virtual point lights, and the numbers in them that have names."""

from ...device.structs import Struct
from ..frame.voxel_shaders import MOST_OUTER_GRIDS

# Cubes that the surface points are sorted in: around every grid of voxels.
INDEX_LEVELS = 1 + MOST_OUTER_GRIDS

TILE = Struct(
    "VplTile",
    origin="vec2",  # lower left texel in the atlas
    light="int",  # row of the table of lamps, where a light may stand several times; -1: of no light
    first="int",  # first tile of the same owner
    owned="int",  # tiles of the same owner
)

# A cell of one level of the pyramid of strengths has so many children along a side.
PYRAMID_STEP = 4

OLD_VIEW = Struct(
    "OldView",
    clip_from_world="mat4",  # of the picture before
    size="vec2",  # pixels
    offset="vec2",  # of its gathering pixels
    stride="float",
)

VPL_FRAME = Struct(
    "VplFrame",
    clip_from_world="mat4",  # of this sample's G-buffer
    eye="vec4",  # FrameInputs.eye
    sky="vec4",  # lower left texel and sides of the sky's tile, 0: none
    **{f"index_{level}": "vec4" for level in range(INDEX_LEVELS)},  # cubes of the indices: lower corner, cells a metre
    cache="vec3",  # lower left texel and side of the cache's points, 0: none
    pool="int",  # entries of the pool
    emitters="vec3",  # as cache
    tiles="int",
    emitter_tile="int",  # -1: none
    sky_tile="int",
    light_tiles="int",  # they come first
    candidates="int",  # entries that a receiver looks at
    occluded="int",  # 1: rays test what is hidden
    contact="int",  # 1: rays test contacts on the screen, too
    bound="float",  # 1: lights are discs of the area they stand for, 0: points
    lobe="float",  # least roughness of the lobes that lights send
    mirrored="int",  # 1: glossy surfaces show the world
    kinds="int",  # bits of SourceKind: which are asked
    index_levels="int",
    number="int",  # of the sample in its sequence of noise
    seed="int",
)
