"""Which point of the cache, or of the emitters, lies nearest: a grid that a ray looks its hit up in.

Its cells have six sides, for the ways that surfaces face, so that the two sides of a thin wall never share a point.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...device.interface import Device, Target, Texture
from ..frame.draws import ADD
from ..frame.light_maps import MapTile
from ..frame.voxels import VoxelGrid
from .shaders import COVER_SCATTER, INDEX_CELLS, INDEX_SCATTER, INDEX_SPREAD
from .sources import Sources
from .structs import INDEX_LEVELS

# How many cells away from a point its cell may lie: points are about so far apart on surfaces.
SPREAD = 3


class PointIndex:
    """The index of one tile of surface points; ``covers``: with how much of their surroundings they cover."""

    def __init__(self, device: Device, *, covers: bool = False) -> None:
        self.device, self._covers = device, covers
        self._grids: list[tuple[Texture, Target]] = []  # the newest first
        self.places = ((0.0, 0.0, 0.0, 0.0),)  # of each level's cube: lower corner, cells a metre
        self._none = device.texture((1, 1), "RGBA32F")

    def update(self, sources: Sources, tile: MapTile, grids: Sequence[VoxelGrid]) -> None:
        """Sort the tile's points into the cells of cubes, one around each of the ``grids``, the innermost first."""
        self._fit(len(grids))
        self.places = tuple((*grid.origin, INDEX_CELLS / (grid.edge * float(grid.size.max()))) for grid in grids)
        x, y, side, _ = sources.points_viewport(tile)
        for _, target in self._grids:
            self.device.clear(target)
        target = self._grids[0][1]
        names = ("position_area_tx", "normal_kind_tx", "flux_tx")
        points = {**dict(zip(names, sources.colors, strict=False)), "pc_origin": (x, y), "pc_side": side}
        for level, place in enumerate(self.places):
            with self.device.drawing(INDEX_SCATTER, target, viewport=_viewport(level), **points) as draw:
                draw(count=9 * side * side, pc_index=place)
        for _ in range(SPREAD):
            (old, _), (_, target) = self._grids
            for level in range(len(self.places)):
                self.device.fullscreen(INDEX_SPREAD, target, viewport=_viewport(level), index_tx=old, pc_level=level)
            self._grids.reverse()
        if self._covers:
            del points["flux_tx"]
            part = _viewport(len(grids))
            with self.device.drawing(COVER_SCATTER, self._grids[0][1], state=ADD, viewport=part, **points) as draw:
                for level, (place, grid) in enumerate(zip(self.places, grids, strict=True)):
                    draw(count=27 * side * side, pc_index=place, pc_level=level, pc_voxel=grid.edge)

    @property
    def cubes(self) -> dict[str, tuple[float, ...]]:
        """Members of VPL_FRAME."""
        return {f"index_{level}": self.places[min(level, len(self.places) - 1)] for level in range(INDEX_LEVELS)}

    def _fit(self, levels: int) -> None:
        size = (6 * INDEX_CELLS, INDEX_CELLS**2 * (levels + self._covers))
        if self._grids and self._grids[0][0].size == size:
            return
        self._free_grids()
        for _ in range(2):
            texture = self.device.texture(size, "RGBA32F")
            self._grids.append((texture, self.device.target([texture])))

    @property
    def texture(self) -> Texture:
        """The sampler of the cells."""
        return self._grids[0][0] if self._grids else self._none

    def free(self) -> None:
        self._free_grids()
        self.device.free(self._none)

    def _free_grids(self) -> None:
        for texture, target in self._grids:
            self.device.free(target)
            self.device.free(texture)
        self._grids.clear()


def _viewport(level: int) -> tuple[int, int, int, int]:
    return 0, level * INDEX_CELLS**2, 6 * INDEX_CELLS, INDEX_CELLS**2
