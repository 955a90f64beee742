"""What a light's reflective shadow map holds, as pictures: a strip of thumbnails, or one of its parts at full size."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...device.interface import Device, Target, Viewport
from ...device.shader import Shader
from ..technique import DebugView
from .light_maps import MapTile
from .structs import MAP_DEFINES, MAP_FACE

if TYPE_CHECKING:
    from ...gpu_scene import GpuScene
    from .reflective_maps import ReflectiveShadowMaps

_WHOSE = "of the light chosen by Light, side by side if it has several"
_PARTS = {
    "DEPTH": ("Depth", "white at the light, black at the far end of the scene and where it sees nothing"),
    "POSITION": ("Position", "X, Y and Z as red, green and blue, from the lower to the upper corner of the scene"),
    "NORMAL": ("Normal", "the way surfaces face: red grows along X, green along Y, blue along Z"),
    "FLUX": ("Flux", "light sent back, by a texel's own area: as bright as the surface looks by this light alone"),
}
_NUMBERS = {part: number for number, part in enumerate(_PARTS)}

MAP_VIEW = Shader(
    name="frame_map_view",
    fragment="frame/map_view_frag.glsl",
    outputs={"out_color": "VEC4"},
    samplers={"position_area_tx": "FLOAT_2D", "normal_tx": "FLOAT_2D", "flux_tx": "FLOAT_2D", "depth_tx": "FLOAT_2D",
              "face_tx": "FLOAT_2D"},
    structs=(MAP_FACE,),
    constants={"pc_low": "VEC3", "pc_high": "VEC3", "pc_face": "INT", "pc_part": "INT"},
    defines=(*MAP_DEFINES, *((f"PART_{part}", str(number)) for part, number in _NUMBERS.items())),
)  # fmt: skip

# Thumbnails take at most such a part of the picture's height, with so many pixels between them.
THUMBNAIL_PART, GAP = 0.25, 4
STRIP = "_MAPS"  # how the key of the strip ends


def map_views(owner: str) -> tuple[DebugView, ...]:
    """The views of a technique that has such maps; ``owner`` is its id in capitals."""
    together = "; ".join(f"{label}: {colors}" for label, colors in _PARTS.values())
    strip = DebugView(
        f"{owner}{STRIP}", "Light Maps", f"Maps {_WHOSE}, below the picture. {together}", over_picture=True
    )
    full = [
        DebugView(f"{owner}_MAP_{part}", f"Light Map: {label}", f"Maps {_WHOSE}: {colors}")
        for part, (label, colors) in _PARTS.items()
    ]
    return strip, *full


def draw_maps(
    device: Device, key: str, maps: ReflectiveShadowMaps, gpu_scene: GpuScene, light: int, target: Target
) -> None:
    """Draw one of ``map_views`` into ``target``; nothing for a light that has no map."""
    tiles = [tile for tile in maps.tiles if tile.light == light and light >= 0]
    width, height = target.size
    part = key.rpartition("_")[2]
    if part in _PARTS:
        side = min(width, height)
        _draw_part(device, part, maps, gpu_scene, tiles, ((width - side) // 2, (height - side) // 2, side), target)
        return
    side = max(min(int(height * THUMBNAIL_PART), width // len(_PARTS) - GAP), 1)
    first = max((width - len(_PARTS) * (side + GAP)) // 2, 0)
    for number, part in enumerate(_PARTS):
        left = first + number * (side + GAP)
        if left + side <= width:
            _draw_part(device, part, maps, gpu_scene, tiles, (left, min(GAP, height - side), side), target)


def _draw_part(
    device: Device,
    part: str,
    maps: ReflectiveShadowMaps,
    gpu_scene: GpuScene,
    tiles: list[MapTile],
    square: tuple[int, int, int],
    target: Target,
) -> None:
    """One part of all of a light's faces, row by row from the bottom of the square of pixels (left, bottom, side)."""
    columns = math.ceil(math.sqrt(len(tiles)))
    rows = -(-len(tiles) // max(columns, 1))
    left, bottom, side = square
    low, high = gpu_scene.boxes[:, 0].min(0), gpu_scene.boxes[:, 1].max(0)
    for place, tile in enumerate(tiles):
        row, column = divmod(place, columns)
        step = max(side // columns, 1)
        viewport: Viewport = (left + column * step, bottom + (rows - 1 - row) * step, step, step)
        if viewport[0] + step > target.size[0] or viewport[1] + step > target.size[1]:  # fewer pixels than faces
            continue
        device.fullscreen(
            MAP_VIEW,
            target,
            viewport=viewport,
            position_area_tx=maps.colors[0],
            normal_tx=maps.colors[1],
            flux_tx=maps.colors[2],
            depth_tx=maps.depth,
            face_tx=maps.face_table,
            pc_low=low,
            pc_high=np.maximum(high, low + 1e-6),
            pc_face=maps.tiles.index(tile),
            pc_part=_NUMBERS[part],
        )
