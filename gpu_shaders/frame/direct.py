"""Direct light: shadow maps and one full-screen pass for each light."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...device.interface import Device, DrawState, Target
from ...scene.data import Light, LightKind, Visibility
from .draws import ADD, draw_scene, visible_draws
from .inputs import FrameInputs
from .light_maps import LightMaps, MapTile
from .lights import emitter_sample, has_size, light_row
from .maps import FILTER_OVERLAP, Face, light_faces
from .shaders import DIRECT, SHADOW, SHADOW_PASSING
from .structs import LIGHT, MAP_FACE

if TYPE_CHECKING:
    from ...gpu_scene import GpuScene

# Full-screen passes, each for one light, in one piece of work: a GPU that is busy for seconds is reset by its driver.
LIGHTS_A_PIECE = 16
# How far direct light is when the shadow maps are drawn, for the progress bar.
SHADOWS_DONE = 0.8


@dataclass(frozen=True, eq=False)
class _Lamp:
    """One light as its pass takes it: a program, and what does not change from sample to sample with still lights."""

    kind: tuple[LightKind, bool, bool]  # the first three keys of DIRECT
    light: np.ndarray  # LIGHT and MAP_FACE as uniform blocks
    face: np.ndarray | None  # None: the table of faces is read instead


class DirectLight:
    """Shadow maps of one renderer, and the lights as its passes take them."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.maps = LightMaps(device, ["RG16F"])
        self._lamps: tuple[_Lamp, ...] = ()
        self._up_to_date: tuple[int, bool, int] | None = None  # scene revision and settings of the last sample
        self._faces_of_still_lights: dict[Hashable, tuple[Face, ...]] = {}

    def draw(
        self, inputs: FrameInputs, target: Target, *, glossy: bool, filtered: bool, resolution: int
    ) -> Iterator[float]:
        """Write this sample's direct light into ``target``; yields progress 0..1.

        ``target`` takes irradiance / pi, and with ``glossy`` the mirrored radiance as a second colour.
        ``filtered``: shadows of sized lights are filtered (PCSS) from one map kept as long as nothing moves; otherwise
        the map is drawn anew from a new point of the emitter every sample, which converges to the true penumbra.
        """
        for done in self._update(inputs, filtered, resolution):
            yield SHADOWS_DONE * done
        if not self._lamps:
            self.device.clear(target)
        for index, lamp in enumerate(self._lamps):
            self._shade(inputs, target, index, lamp, glossy)
            if index % LIGHTS_A_PIECE == LIGHTS_A_PIECE - 1:
                yield SHADOWS_DONE + (1.0 - SHADOWS_DONE) * index / len(self._lamps)

    def free(self) -> None:
        self.maps.free()
        self._lamps, self._up_to_date = (), None

    def _update(self, inputs: FrameInputs, filtered: bool, resolution: int) -> Iterator[float]:
        """Bring lights and shadow maps up to date for this sample; yields progress 0..1."""
        key = (inputs.gpu_scene.revision, filtered, resolution)
        if key != self._up_to_date:
            self._up_to_date, self._faces_of_still_lights = None, {}
        elif not self._any_moves(inputs, filtered) and not len(inputs.gpu_scene.passing_boxes):
            return
        self._lay_out(inputs, filtered, resolution)
        yield from self._draw_shadows(inputs.gpu_scene, inputs.noise_seed(4) + inputs.sample)
        self._up_to_date = key

    def _any_moves(self, inputs: FrameInputs, filtered: bool) -> bool:
        """Whether some light shines from another point of its emitter in every sample."""
        return not filtered and any(has_size(light) for light in inputs.gpu_scene.scene.lights)

    def _lay_out(self, inputs: FrameInputs, filtered: bool, resolution: int) -> None:
        tiles: list[MapTile] = []
        rows, only_tiles = [], []
        for index, light in enumerate(inputs.gpu_scene.scene.lights):
            moves = has_size(light) and not filtered
            source = emitter_sample(light, inputs.sample, _offset(inputs.seed, index)) if moves else None
            faces = self._faces(light, inputs.gpu_scene.boxes, source)
            rows.append(light_row(light, source, len(tiles), len(faces)))
            tiles += [MapTile(light.key, index, face, _look(face, inputs)) for face in faces]
            one_face = light.kind in (LightKind.SPOT, LightKind.SUN) and len(faces) == 1
            only_tiles.append(tiles[-1] if one_face else None)
        self.maps.lay_out(tiles, resolution)
        packed = LIGHT.pack(rows, for_uniform=True)
        self._lamps = tuple(
            _Lamp(
                (light.kind, bool(row["filtered"]), tile is not None),
                block,
                None if tile is None else MAP_FACE.pack([self.maps.face_row(tile)], for_uniform=True)[0],
            )
            for light, row, block, tile in zip(inputs.gpu_scene.scene.lights, rows, packed, only_tiles, strict=True)
        )

    def _faces(self, light: Light, boxes: np.ndarray, source: np.ndarray | None) -> tuple[Face, ...]:
        if not light.casts_shadow:
            return ()
        if source is not None:
            return light_faces(light, boxes, source)
        if light.key not in self._faces_of_still_lights:
            overlap = FILTER_OVERLAP if has_size(light) else 1.0
            self._faces_of_still_lights[light.key] = light_faces(light, boxes, overlap=overlap)
        return self._faces_of_still_lights[light.key]

    def _draw_shadows(self, gpu_scene: GpuScene, dither: int) -> Iterator[float]:
        stale = self.maps.stale(gpu_scene)
        for done, tile in enumerate(stale):
            target, viewport = self.maps.begin(tile, gpu_scene)
            draws = visible_draws(gpu_scene, Visibility.SHADOW, tile.face.sees)
            solid, thin = gpu_scene.divided(draws)
            face = {
                "pc_clip_from_world": tile.face.clip_from_world,
                "pc_perspective": int(tile.face.perspective),
                "pc_far": tile.face.far,
                "pc_tile": float(viewport[2]),
            }
            draw_scene(self.device, gpu_scene, SHADOW, target, solid, viewport=viewport, **face)
            if thin:
                extra = {"pc_eye": tile.face.eye, "pc_dither": dither}
                draw_scene(self.device, gpu_scene, SHADOW_PASSING, target, thin, viewport=viewport, **face, **extra)
            yield (done + 1) / len(stale)

    def _shade(self, inputs: FrameInputs, target: Target, index: int, lamp: _Lamp, glossy: bool) -> None:
        extra: dict[str, Any] = {"face_tx": self.maps.face_table} if lamp.face is None else {"direct_face": lamp.face}
        if glossy:
            extra |= {"specular_tx": inputs.gbuffer.specular, "pc_eye": inputs.eye}
        self.device.fullscreen(
            DIRECT[*lamp.kind, glossy],
            target,
            state=ADD if index else DrawState(),  # the first covers what was there
            direct_light=lamp.light,
            position_tx=inputs.gbuffer.position,
            normal_tx=inputs.gbuffer.normal,
            shadow_depth_tx=self.maps.depth,
            shadow_slope_tx=self.maps.colors[0],
            pc_seed=inputs.noise_seed(0) + 2 * index,
            pc_sample=inputs.sample,
            **extra,
        )


def _look(face: Face, inputs: FrameInputs) -> bytes:
    """What else a map is drawn by: what lets light pass is drawn anew in every sample."""
    return str(inputs.sample).encode() if face.sees(inputs.gpu_scene.passing_boxes).any() else b""


def _offset(seed: int, light: int) -> np.ndarray:
    """Where the light's sequence of emitter points begins: its own for every light, and always the same."""
    return np.random.default_rng((seed, light)).random(3)
