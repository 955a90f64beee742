"""Tables of the virtual point lights, and the numbers in them that have names."""

from enum import IntEnum

from ...device.structs import Struct


class Kind(IntEnum):
    """What a texel of the atlas stands for. The atlas keeps it in the normal's fourth channel; 0 is an empty texel."""

    BOUNCE = 1  # light that a lamp's surroundings reflect
    EMISSION = 2  # an emissive surface
    CACHE = 3  # a point of the radiance cache: what light of earlier bounces it reflects
    SKY = 4  # a patch of the world's background, far away


KIND_DEFINES = tuple((f"VPL_{kind.name}", str(int(kind))) for kind in Kind)

TILE = Struct(
    "VplTile",
    origin="vec2",  # lower left texel in the atlas
    light="int",  # index of the light whose tile it is, -1: of no light
    first="int",  # first tile of the same owner
    owned="int",  # tiles of the same owner
)

# A cell of one level of the pyramid of strengths has so many children along a side.
PYRAMID_STEP = 4
