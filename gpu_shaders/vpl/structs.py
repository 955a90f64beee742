"""Tables of the virtual point lights, and the numbers in them that have names."""

from ...device.structs import Struct

TILE = Struct(
    "VplTile",
    origin="vec2",  # lower left texel in the atlas
    light="int",  # index of the light whose tile it is, -1: of no light
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
