"""The atlas that holds every light's map, and which of its tiles are out of date.

A tile is drawn again only when its light changed or when something moved that it sees. Moving one of 64 lights
redraws one tile; orbiting the view redraws none.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...device.formats import FORMATS
from ...device.interface import Device, Target, Texture
from .maps import Atlas, Face, face_row
from .structs import MAP_FACE
from .tables import replace_table

if TYPE_CHECKING:
    from ...gpu_scene import GpuScene

# Memory of one atlas beyond which more lights get smaller tiles, which the statistics say.
ATLAS_BYTES = 256 << 20
DEPTH_FORMAT = "DEPTH32F"


@dataclass(frozen=True, eq=False)
class MapTile:
    """One face in its place. ``look`` is whatever else of the light the picture depends on.

    ``part`` of its tile's width is drawn, a power of 1/2.
    """

    owner: Hashable  # Light.key, or that and the number of a point of its emitter
    light: int  # index of the scene's light, -1 for none
    face: Face
    look: bytes = b""
    part: float = 1.0
    lamp: int = -1  # index into the table of lamps: a light may stand in it several times

    @property
    def key(self) -> Hashable:
        return self.owner, self.face.name

    @property
    def fingerprint(self) -> bytes:
        return self.face.clip_from_world.tobytes() + np.array([self.face.far, self.part]).tobytes() + self.look


class LightMaps:
    """Tiles for one kind of map; ``formats`` are its colour textures beside the depth."""

    shows_materials = False  # whether a tile must be drawn again when a material changes that it sees

    def __init__(self, device: Device, formats: Sequence[str]) -> None:
        self.device = device
        self.formats = tuple(formats)
        self.atlas: Atlas | None = None
        self.target: Target | None = None
        self.colors: tuple[Texture, ...] = ()
        self.depth: Texture | None = None
        self.face_table: Texture | None = None
        self.tiles: tuple[MapTile, ...] = ()
        self.drawn = 0  # tiles drawn since the beginning
        self._slots: dict[Hashable, int] = {}
        self._drawn: dict[Hashable, tuple[bytes, int]] = {}  # fingerprint, revision of the scene

    def lay_out(self, tiles: Sequence[MapTile], wanted: int) -> None:
        """Give every tile a place, and upload the table of faces in the order of ``tiles``."""
        self.tiles = tuple(tiles)
        count = max(len(tiles), 1)
        texels = ATLAS_BYTES // sum(FORMATS[name].bytes for name in (*self.formats, DEPTH_FORMAT))
        fitting = Atlas.fitting(count, wanted, texels, self.device.max_texture_size)
        if self.atlas is None or fitting.tile != self.atlas.tile or self.atlas.tiles < count:
            whole_rows = -(-count // fitting.columns) * fitting.columns
            self._allocate(Atlas.fitting(whole_rows, wanted, texels, self.device.max_texture_size))
        assert self.atlas is not None and self.target is not None
        keys = {tile.key for tile in tiles}
        for gone in self._slots.keys() - keys:
            self.device.clear(self.target, viewport=self.atlas.viewport(self._slots.pop(gone)))
            self._drawn.pop(gone, None)
        free = iter(sorted(set(range(self.atlas.tiles)) - set(self._slots.values())))
        for tile in tiles:
            if tile.key not in self._slots:
                self._slots[tile.key] = next(free)
        rows = [self.face_row(tile) for tile in tiles]
        self.face_table = replace_table(self.device, MAP_FACE.pack(rows), self.face_table)

    def face_row(self, tile: MapTile) -> dict:
        """The MAP_FACE row of a tile that has its place."""
        assert self.atlas is not None
        return {**face_row(tile.face, self.atlas, self._slots[tile.key]), "tile": self.viewport(tile)[2]}

    def stale(self, gpu_scene: GpuScene) -> list[MapTile]:
        """The tiles that must be drawn again for this scene. The others are now known to be good for it."""
        stale = [tile for tile in self.tiles if self._is_stale(tile, gpu_scene)]
        out_of_date = {tile.key for tile in stale}
        for key, (fingerprint, _) in self._drawn.items():
            if key not in out_of_date:
                self._drawn[key] = fingerprint, gpu_scene.revision
        return stale

    def _is_stale(self, tile: MapTile, gpu_scene: GpuScene) -> bool:
        fingerprint, revision = self._drawn.get(tile.key, (b"", -1))
        if fingerprint != tile.fingerprint:
            return True
        moved = gpu_scene.moved_since(revision, shapes_only=not self.shows_materials)
        return moved is None or bool(tile.face.sees(moved).any())

    def viewport(self, tile: MapTile) -> tuple[int, int, int, int]:
        """The rectangle in the atlas that the tile is drawn in: x, y, width, height in texels."""
        assert self.atlas is not None
        x, y, width, height = self.atlas.viewport(self._slots[tile.key])
        return x, y, max(int(width * tile.part), 1), max(int(height * tile.part), 1)

    def begin(self, tile: MapTile, gpu_scene: GpuScene) -> tuple[Target, tuple[int, int, int, int]]:
        """Clear a tile for drawing and count it as up to date; returns where to draw."""
        assert self.target is not None and self.atlas is not None
        whole = self.atlas.viewport(self._slots[tile.key])
        self.device.clear(self.target, color=(0.0, 0.0, 0.0, 0.0), depth=1.0, viewport=whole)
        self._drawn[tile.key] = tile.fingerprint, gpu_scene.revision
        self.drawn += 1
        return self.target, self.viewport(tile)

    def longest_ago_first(self, tiles: Sequence[MapTile]) -> list[MapTile]:
        """The tiles in the order of when they were last good, those that never were first."""
        return sorted(tiles, key=lambda tile: self._drawn.get(tile.key, (b"", -1))[1])

    def _allocate(self, atlas: Atlas) -> None:
        self._free_textures()
        self.atlas = atlas
        self._slots.clear()
        self._drawn.clear()
        self.colors = tuple(self.device.texture(atlas.size, name) for name in self.formats)
        self.depth = self.device.texture(atlas.size, DEPTH_FORMAT)
        self.target = self.device.target(self.colors, self.depth)

    def _free_textures(self) -> None:
        for texture in (self.target, *self.colors, self.depth):
            if texture is not None:
                self.device.free(texture)
        self.target, self.colors, self.depth = None, (), None

    def free(self) -> None:
        self._free_textures()
        if self.face_table is not None:
            self.device.free(self.face_table)
            self.face_table = None
        self.atlas = None
        self._slots.clear()
        self._drawn.clear()
