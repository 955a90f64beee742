"""Reflective shadow maps: one atlas with a tile for every face of every light."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...device.interface import Device, Texture
from ...scene.data import Visibility
from .draws import draw_scene, visible_draws
from .light_maps import LightMaps, MapTile
from .lights import light_row
from .maps import light_faces
from .reflective_shaders import REFLECT
from .structs import LIGHT
from .tables import replace_table

if TYPE_CHECKING:
    from ...gpu_scene import GpuScene

# What a light's picture does not depend on: where its tiles lie in the table of faces.
_PLACE = {"first_face": 0}


class ReflectiveShadowMaps(LightMaps):
    """Colour textures: position and texel area (RGBA32F); normal and SourceKind (RGBA16F); diffusely reflected flux in
    watts, and how much it counts where texels are chosen by strength (RGBA32F); incident flux times specular
    reflectance, and its lobe (RGBA32F, lobe_lib.glsl).

    Maps are drawn from the emitter's centre: a sized light's bounce is that of a point with its power, or of a few.
    """

    shows_materials = True

    def __init__(self, device: Device) -> None:
        super().__init__(device, ["RGBA32F", "RGBA16F", "RGBA32F", "RGBA32F"])
        self.light_table: Texture | None = None
        self._light_blocks = np.zeros((0, 0))  # its rows as uniform blocks, which fragments need not fetch
        self.pending = 0  # tiles that are known to be out of date
        self._laid_out: tuple[int, int] | None = None

    def update(self, gpu_scene: GpuScene, resolution: int, most: int = 0) -> Iterator[float]:
        """Draw the tiles that are out of date; yields progress 0..1 after each.

        ``most`` of them at once, 0 for all; ``pending`` tells how many are left for the next calls.
        """
        if self._laid_out == (gpu_scene.revision, resolution):
            return
        self._lay_out_lights(gpu_scene, resolution)
        stale = self.longest_ago_first(self.stale(gpu_scene))
        drawn = stale[:most] if most else stale
        for done, tile in enumerate(drawn):
            if tile.light >= 0:
                self._draw(gpu_scene, tile)
            else:
                self._draw_other(gpu_scene, tile)
            yield (done + 1) / len(drawn)
        self.pending = len(stale) - len(drawn)
        self._laid_out = None if self.pending else (gpu_scene.revision, resolution)

    def read(self) -> Iterator[tuple[int, str, dict[str, np.ndarray]]]:
        """Every tile read back: index of its light, name of its face, and the layers of ``renderer.RsmBuffers``."""
        assert self.depth is not None
        position, normal, flux = (self.device.read(texture)[..., :3] for texture in self.colors[:3])
        depth = self.device.read(self.depth)
        for tile in self.tiles:
            if tile.light < 0:
                continue
            x, y, width, height = self.viewport(tile)
            part = np.s_[y : y + height, x : x + width]
            metres = np.where(depth[part] < 1.0, tile.face.metres(depth[part]), np.float32(0.0))
            layers = {"depth": metres, "position": position[part], "normal": normal[part], "flux": flux[part]}
            yield tile.light, tile.face.name, layers

    def free(self) -> None:
        super().free()
        if self.light_table is not None:
            self.device.free(self.light_table)
            self.light_table = None
        self._laid_out = None

    def _lay_out_lights(self, gpu_scene: GpuScene, resolution: int) -> None:
        tiles: list[MapTile] = []
        rows = []
        largest = max([1.0, *(light.map_scale for light in gpu_scene.scene.lights if light.bounce > 0.0)])
        parts = self._parts(gpu_scene)
        points = self._emitter_points(gpu_scene, parts)
        for index, light in enumerate(gpu_scene.scene.lights):
            own = points[index] if light.bounce > 0.0 else ()
            # Half as wide: four points are drawn in as many texels as one. Their places in the atlas are whole tiles.
            part = parts[index] * light.map_scale / largest / (1 if len(own) <= 1 else 2)
            for number, point in enumerate(own):
                faces = light_faces(light, gpu_scene.boxes, point)
                row = light_row(light, None, len(tiles), len(faces))
                row["intensity"] = row["intensity"] * (light.bounce / len(own))
                row["position"] = row["position"] if point is None else point
                look = LIGHT.pack([{**row, **_PLACE}]).tobytes()
                owner = light.key if len(own) == 1 else (light.key, number)
                tiles += [MapTile(owner, index, face, look, part, len(rows)) for face in faces]
                rows.append(row)
        self.lay_out((*tiles, *self._other_tiles(gpu_scene)), int(resolution * largest))
        self.light_table = replace_table(self.device, LIGHT.pack(rows), self.light_table)
        self._light_blocks = LIGHT.pack(rows, for_uniform=True)

    def _emitter_points(self, gpu_scene: GpuScene, parts: Sequence[float]) -> Sequence[Sequence[np.ndarray | None]]:
        """For each light the points of its emitter that maps are drawn from, each for its part of the light; None is
        the centre. ``parts``: of their tiles' widths that the lights have.
        """
        return [(None,)] * len(gpu_scene.scene.lights)

    def _parts(self, gpu_scene: GpuScene) -> Sequence[float]:
        """What part of its tiles' width each light is drawn in."""
        return [1.0] * len(gpu_scene.scene.lights)

    def _other_tiles(self, gpu_scene: GpuScene) -> Sequence[MapTile]:
        """Tiles behind the lights' that are no picture from a light; their ``light`` is -1."""
        return ()

    def _draw_other(self, gpu_scene: GpuScene, tile: MapTile) -> None:
        raise NotImplementedError

    def _draw(self, gpu_scene: GpuScene, tile: MapTile) -> None:
        target, viewport = self.begin(tile, gpu_scene)
        draws = visible_draws(gpu_scene, Visibility.SHADOW | Visibility.BOUNCE, tile.face.sees)
        draw_scene(
            self.device,
            gpu_scene,
            REFLECT,
            target,
            draws,
            lets_pass=gpu_scene.lets_lamps_pass,
            viewport=viewport,
            reflected_light=self._light_blocks[tile.lamp],
            pc_clip_from_world=tile.face.clip_from_world,
            pc_perspective=int(tile.face.perspective),
            pc_far=tile.face.far,
            pc_texel_measure=tile.face.texel_measure / viewport[2] ** 2,
            face_tx=self.face_table,
            pc_served=self._served_by(tile),
            pc_dither=0,
        )

    def _served_by(self, tile: MapTile) -> int:
        """Index of the face whose part of the scene this tile leaves to it: that inside a sun's wider one. Or -1."""
        index = self.tiles.index(tile)
        inside = index and not tile.face.perspective and self.tiles[index - 1].owner == tile.owner
        return index - 1 if inside else -1
