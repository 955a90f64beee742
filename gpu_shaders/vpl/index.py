"""Which point of the cache, or of the emitters, lies nearest: a grid that a ray looks its hit up in.

Its cells have six sides, for the ways that surfaces face, so that the two sides of a thin wall never share a point.
"""

from __future__ import annotations

from ...device.interface import Device, Target, Texture
from ..frame.light_maps import MapTile
from ..frame.voxels import VoxelGrid
from .shaders import INDEX_CELLS, INDEX_SCATTER, INDEX_SPREAD
from .sources import Sources

# How many cells away from a point its cell may lie: points are about so far apart on surfaces.
SPREAD = 3


class PointIndex:
    """The index of one tile of surface points."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._grids: list[tuple[Texture, Target]] = []  # the newest first
        self.place = (0.0, 0.0, 0.0, 0.0)  # lower corner of the cube, cells a metre
        self._none = device.texture((1, 1), "R32F")

    def update(self, sources: Sources, tile: MapTile, grid: VoxelGrid) -> None:
        """Sort the tile's points into the cells of the cube that ``grid`` lies in."""
        if not self._grids:
            for _ in range(2):
                texture = self.device.texture((6 * INDEX_CELLS, INDEX_CELLS**2), "R32F")
                self._grids.append((texture, self.device.target([texture])))
        extent = grid.edge * float(grid.size.max())
        self.place = (*grid.origin, INDEX_CELLS / extent)
        x, y, side, _ = sources.points_viewport(tile)
        shared = {"position_area_tx": sources.colors[0], "pc_index": self.place}
        shared |= {"pc_origin": (x, y), "pc_side": side}
        target = self._grids[0][1]
        self.device.clear(target)
        with self.device.drawing(
            INDEX_SCATTER, target, normal_kind_tx=sources.colors[1], flux_tx=sources.colors[2], **shared
        ) as draw:
            draw(count=9 * side * side)
        for _ in range(SPREAD):
            (old, _), (_, target) = self._grids
            self.device.fullscreen(INDEX_SPREAD, target, index_tx=old, **shared)
            self._grids.reverse()

    @property
    def texture(self) -> Texture:
        """The sampler of the cells."""
        return self._grids[0][0] if self._grids else self._none

    def free(self) -> None:
        for texture, target in self._grids:
            self.device.free(target)
            self.device.free(texture)
        self._grids.clear()
        self.device.free(self._none)
