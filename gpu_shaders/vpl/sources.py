"""One atlas of everything that sends light: reflective shadow maps, emissive surfaces, the sky, the radiance cache.

Every texel is a virtual point light: position, footprint, normal, flux. What is not a lamp's map takes a tile beside
them, so that one pool is drawn from all (``pool.py``) and nothing behind it asks where a light came from.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...device.interface import Device, Texture
from ...scene.data import LightKind
from ..frame.light_maps import MapTile
from ..frame.lights import emitter_points
from ..frame.maps import Face
from ..frame.reflective_maps import ReflectiveShadowMaps
from ..frame.surface_points import SurfacePoints
from ..frame.tables import replace_table
from ..frame.voxel_grids import grid_bounds
from .shaders import SKY
from .structs import TILE

if TYPE_CHECKING:
    from ...gpu_scene import GpuScene

# Texels along a tile's side are a multiple of this, so that no block of the pyramid straddles two tiles.
TILE_STEP = 16
# The sky's patches lie so many times farther than the scene is large: beyond the parallax that a float could show.
# Of what they send, a sphere around the scene receives 1 / (4 SKY_DISTANCE^2): their strength when lights are chosen.
SKY_DISTANCE = 1e3
# Points along a side of the square that emitters, and the cache, have in their tile.
POINTS_SIDE = 64
# Part of its tiles' width that a light gets whose power is at least such a share of the strongest one's.
PARTS = ((1.0, 1 / 16), (0.5, 1 / 256), (0.25, 0.0))
# An area light has a point for each such part of the scene's diagonal, up to so many, and all lights together so many.
EMITTER_PART, MOST_EMITTER_POINTS, MOST_POINTS = 1 / 8, 4, 12
EMITTERS, CACHE, SKY_PATCHES = "emitters", "cache", "sky"  # owners of the tiles that are no light's

# The face of a tile that is no picture: it "sees" every box, so that whatever moves makes it be drawn again.
_NO_FACE = Face("", np.zeros((4, 4)), (1.0, 1.0), 0.0, 1.0, False)


class Sources(ReflectiveShadowMaps):
    """The atlas of a scene's virtual point lights; ``revision`` grows whenever a texel of it may have changed."""

    def __init__(self, device: Device) -> None:
        super().__init__(device)
        self.revision = 0
        self.points_drawn: Counter[str] = Counter()  # how often, by their owner
        self.tile_table: Texture | None = None
        self._emitters = SurfacePoints(device, "EMISSION")
        self._cache = SurfacePoints(device, "AREA")
        self._with_cache = False

    def update_all(self, gpu_scene: GpuScene, resolution: int, with_cache: bool, most: int) -> Iterator[float]:
        """Draw what is out of date, at most ``most`` tiles of it, 0 for all; yields progress 0..1.

        ``with_cache``: whether surfaces reflect light once more.
        """
        if with_cache != self._with_cache:
            self._with_cache, self._laid_out = with_cache, None
        drawn = self.drawn
        yield from self.update(gpu_scene, -(-resolution // TILE_STEP) * TILE_STEP, most)
        self.revision += self.drawn != drawn

    def tile_of(self, owner: str) -> MapTile | None:
        """The tile of emitters, cache or sky, if there is one."""
        return next((tile for tile in reversed(self.tiles) if tile.owner == owner), None)

    def index_of(self, owner: str) -> int:
        """That tile's number, -1 where there is none."""
        return next((index for index, tile in enumerate(self.tiles) if tile.owner == owner), -1)

    @property
    def light_tiles(self) -> int:
        """How many tiles are lights': they come first."""
        return sum(tile.light >= 0 for tile in self.tiles)

    def points_viewport(self, tile: MapTile) -> tuple[int, int, int, int]:
        """Where a tile of surface points has them."""
        x, y, width, _ = self.viewport(tile)
        side = min(width, POINTS_SIDE)
        return x, y, side, side

    def free(self) -> None:
        super().free()
        self._emitters.free()
        self._cache.free()
        if self.tile_table is not None:
            self.device.free(self.tile_table)
            self.tile_table = None

    def lay_out(self, tiles: Sequence[MapTile], wanted: int) -> None:
        super().lay_out(tiles, wanted)
        self.revision += 1
        counts = Counter(tile.owner for tile in self.tiles)
        firsts: dict[Hashable, int] = {}
        rows = []
        for index, tile in enumerate(self.tiles):
            first = firsts.setdefault(tile.owner, index)
            origin = self.viewport(tile)[:2]
            rows.append({"origin": origin, "light": tile.lamp, "first": first, "owned": counts[tile.owner]})
        self.tile_table = replace_table(self.device, TILE.pack(rows), self.tile_table)

    def _parts(self, gpu_scene: GpuScene) -> Sequence[float]:
        """Lights that are much weaker than the strongest send few virtual lights: coarser maps do for them."""
        low, high = gpu_scene.boxes[:, 0].min(0), gpu_scene.boxes[:, 1].max(0)
        across = float(np.linalg.norm(high - low)) ** 2  # m² that a sun shines on, about
        lights = gpu_scene.scene.lights
        power = [
            np.mean(light.power) * light.bounce * (across if light.kind is LightKind.SUN else 1.0) for light in lights
        ]
        strongest = max([*power, 1e-30])
        return [next((part for part, share in PARTS if p >= share * strongest), PARTS[-1][0]) for p in power]

    def _emitter_points(self, gpu_scene: GpuScene, parts: Sequence[float]) -> Sequence[Sequence[np.ndarray | None]]:
        """Strong area lights that are wide in the scene send from several points: what is near is lit by all of it."""
        low, high = grid_bounds(gpu_scene.boxes)
        across = EMITTER_PART * float(np.linalg.norm(high - low))
        lights = gpu_scene.scene.lights
        strong = [light.kind is LightKind.AREA and part == 1.0 for light, part in zip(lights, parts, strict=True)]
        most = min(MOST_EMITTER_POINTS, MOST_POINTS // max(sum(strong), 1))
        return [
            emitter_points(light, across, most) if is_strong else (None,)
            for light, is_strong in zip(lights, strong, strict=True)
        ]

    def _other_tiles(self, gpu_scene: GpuScene) -> Sequence[MapTile]:
        tiles = []
        if gpu_scene.emits:
            tiles.append(MapTile(EMITTERS, -1, _NO_FACE))
        if gpu_scene.environment.lights or gpu_scene.environment.mirrored:
            look = np.array([gpu_scene.environment.revision, *_sky_sphere(gpu_scene.boxes)]).tobytes()
            tiles.append(MapTile(SKY_PATCHES, -1, _NO_FACE, look))
        if self._with_cache:
            tiles.append(MapTile(CACHE, -1, _NO_FACE))
        return tiles

    def _draw_other(self, gpu_scene: GpuScene, tile: MapTile) -> None:
        target, viewport = self.begin(tile, gpu_scene)
        if tile.owner == SKY_PATCHES:
            self.device.fullscreen(
                SKY,
                target,
                viewport=viewport,
                pc_sphere=_sky_sphere(gpu_scene.boxes),
                environment_tx=gpu_scene.environment.texture,
                pc_diffuse=float(gpu_scene.environment.lights),
                pc_counts=0.25 / SKY_DISTANCE**2,
                pc_viewport=viewport,
            )
            return
        points = self._emitters if tile.owner == EMITTERS else self._cache
        place = self.points_viewport(tile)
        points.update(gpu_scene, place[2])
        self.points_drawn[str(tile.owner)] += 1
        points.draw(gpu_scene, target, place)


def _sky_sphere(boxes: np.ndarray) -> tuple[float, float, float, float]:
    """Centre and radius of the sphere on which the sky's patches lie."""
    low, high = boxes[:, 0].min(0), boxes[:, 1].max(0)
    center = 0.5 * (low + high)
    return (*center, SKY_DISTANCE * max(float(np.linalg.norm(high - low)), 1e-3))
