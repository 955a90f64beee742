"""The pool: some thousand virtual point lights of all sources, chosen anew in every sample in proportion to strength.

P. Clarberg et al., "Wavelet Importance Sampling", SIGGRAPH 2005 (hierarchical warping). What a gather costs depends on
the pool's size and on the pixels, not on how many lights there are.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...device.interface import Device, Target, Texture
from .shaders import BLOCK_STRENGTH, POOL, POOL_ROW, REDUCE, TILE_STRENGTH, TILES
from .sources import TILE_STEP, Sources
from .structs import PYRAMID_STEP

# Blocks of the pyramid's levels, texels along a side; the coarsest may be cut by the tile's edge.
FINE, MIDDLE, COARSE = PYRAMID_STEP, PYRAMID_STEP**2, PYRAMID_STEP**3
assert MIDDLE == TILE_STEP


class Pool:
    """Strengths of the atlas in a pyramid, and the entries drawn by them."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._levels: dict[str, tuple[Texture, Target]] = {}
        self._entries: tuple[Texture, ...] = ()
        self._entry_target: Target | None = None
        self._revision = -1

    def draw(self, sources: Sources, count: int, number: int, seed: int) -> None:
        """Choose ``count`` entries; ``number`` is another one in every sample."""
        assert sources.atlas is not None
        self._measure(sources)
        rows = -(-count // POOL_ROW)
        if self._entry_target is None or self._entry_target.size[1] != rows:
            self._free_entries()
            self._entries = tuple(self.device.texture((POOL_ROW, rows), "RGBA32F") for _ in range(4))
            self._entry_target = self.device.target(self._entries)
        positions, normals, fluxes, speculars = sources.colors
        levels: dict[str, Any] = {f"{name}_tx": texture for name, (texture, _) in self._levels.items()}
        del levels["strength_tx"]  # of whole tiles: their sums have it
        self.device.fullscreen(
            POOL,
            self._entry_target,
            position_area_tx=positions,
            normal_kind_tx=normals,
            flux_tx=fluxes,
            specular_tx=speculars,
            **levels,
            tile_tx=sources.tile_table,
            pc_count=count,
            pc_number=number,
            pc_seed=seed,
            pc_tiles=len(sources.tiles),
            pc_light_tiles=sources.light_tiles,
            pc_tile=sources.atlas.tile,
            pc_coarse=_blocks(sources.atlas.tile),
        )

    def bindings(self) -> Mapping[str, Any]:
        """The samplers of the entries and of the tiles' sums."""
        names = ("pool_position_tx", "pool_normal_tx", "pool_flux_tx", "pool_specular_tx")
        return {**dict(zip(names, self._entries, strict=True)), "sums_tx": self._levels["sums"][0]}

    def free(self) -> None:
        self._free_entries()
        self._free_levels()

    def _measure(self, sources: Sources) -> None:
        """Bring the pyramid up to date with the atlas."""
        if self._revision == sources.revision:
            return
        assert sources.atlas is not None
        tile, blocks = sources.atlas.tile, _blocks(sources.atlas.tile)
        columns, rows = (side // tile for side in sources.atlas.size)
        sides = {"fine": tile // FINE, "middle": tile // MIDDLE, "coarse": blocks}
        sizes = {name: (columns * side, rows * side) for name, side in sides.items()}
        count = len(sources.tiles)
        self._allocate({**sizes, "strength": (count, 1), "sums": (count, 1)})
        self._revision = sources.revision
        fluxes, speculars = sources.colors[2:4]
        self.device.fullscreen(BLOCK_STRENGTH, self._levels["fine"][1], flux_tx=fluxes, specular_tx=speculars)
        for child, parent in (("fine", "middle"), ("middle", "coarse")):
            self.device.fullscreen(
                REDUCE,
                self._levels[parent][1],
                level_tx=self._levels[child][0],
                pc_children=sides[child],
                pc_parents=sides[parent],
            )
        self.device.fullscreen(
            TILE_STRENGTH,
            self._levels["strength"][1],
            level_tx=self._levels["coarse"][0],
            tile_tx=sources.tile_table,
            pc_tile=tile,
            pc_blocks=blocks,
        )
        self.device.fullscreen(
            TILES,
            self._levels["sums"][1],
            strength_tx=self._levels["strength"][0],
            tile_tx=sources.tile_table,
            pc_tiles=count,
            pc_light_tiles=sources.light_tiles,
        )

    def _allocate(self, sizes: Mapping[str, tuple[int, int]]) -> None:
        if {name: texture.size for name, (texture, _) in self._levels.items()} == dict(sizes):
            return
        self._free_levels()
        for name, size in sizes.items():
            texture = self.device.texture(size, "RGBA32F" if name == "sums" else "R32F")
            self._levels[name] = (texture, self.device.target([texture]))

    def _free_levels(self) -> None:
        for texture, target in self._levels.values():
            self.device.free(target)
            self.device.free(texture)
        self._levels.clear()
        self._revision = -1

    def _free_entries(self) -> None:
        for resource in (self._entry_target, *self._entries):
            self.device.free(resource)
        self._entries, self._entry_target = (), None


def _blocks(tile: int) -> int:
    """Coarse blocks along a side of a tile."""
    return -(-tile // COARSE)
