"""Direct light: shadow maps and one full-screen pass over all lights."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...device.interface import Device, DrawState, Target, Texture
from ...scene.data import Light, LightKind, Visibility
from .draws import ADD, draw_scene, visible_draws
from .inputs import FrameInputs
from .light_maps import LightMaps, MapTile
from .lights import emitter_sample, has_size, light_row
from .maps import FILTER_OVERLAP, Face, light_faces
from .shaders import DIRECT, SHADOW
from .structs import LIGHT
from .tables import replace_table

if TYPE_CHECKING:
    from ...gpu_scene import GpuScene

# Lights in one full-screen pass: a GPU that is busy for seconds in one call is reset by its driver.
LIGHTS_A_PASS = 16
# How far direct light is when the shadow maps are drawn, for the progress bar.
SHADOWS_DONE = 0.8


@dataclass(frozen=True)
class _Run:
    """Neighbours in the table of lights that one program shades. ``kind``: the first three keys of DIRECT."""

    kind: tuple[LightKind, bool, bool]
    first: int
    last: int


class DirectLight:
    """Shadow maps and the light table of one renderer."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.maps = LightMaps(device, ["RG16F"])
        self.light_table: Texture | None = None
        self._runs: tuple[_Run, ...] = ()
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
        if not self._runs:
            self.device.clear(target)
        for run in self._runs:
            self._shade(inputs, target, run, glossy)
            yield SHADOWS_DONE + (1.0 - SHADOWS_DONE) * run.last / self._runs[-1].last

    def free(self) -> None:
        self.maps.free()
        if self.light_table is not None:
            self.device.free(self.light_table)
            self.light_table = None
        self._up_to_date = None

    def _update(self, inputs: FrameInputs, filtered: bool, resolution: int) -> Iterator[float]:
        """Bring light table and shadow maps up to date for this sample; yields progress 0..1."""
        key = (inputs.gpu_scene.revision, filtered, resolution)
        if key != self._up_to_date:
            self._up_to_date, self._faces_of_still_lights = None, {}
        elif not self._any_moves(inputs, filtered):
            return
        self._lay_out(inputs, filtered, resolution)
        yield from self._draw_shadows(inputs.gpu_scene)
        self._up_to_date = key

    def _any_moves(self, inputs: FrameInputs, filtered: bool) -> bool:
        """Whether some light shines from another point of its emitter in every sample."""
        return not filtered and any(has_size(light) for light in inputs.gpu_scene.scene.lights)

    def _lay_out(self, inputs: FrameInputs, filtered: bool, resolution: int) -> None:
        tiles: list[MapTile] = []
        rows, kinds = [], []
        for index, light in enumerate(inputs.gpu_scene.scene.lights):
            moves = has_size(light) and not filtered
            source = emitter_sample(light, inputs.sample, _offset(inputs.seed, index)) if moves else None
            faces = self._faces(light, inputs.gpu_scene.boxes, source)
            rows.append(light_row(light, source, len(tiles), len(faces)))
            tiles += [MapTile(light.key, index, face) for face in faces]
            one_face = light.kind in (LightKind.SPOT, LightKind.SUN) and len(faces) == 1
            kinds.append((light.kind, bool(rows[-1]["filtered"]), one_face))
        self.maps.lay_out(tiles, resolution)
        order = sorted(range(len(rows)), key=lambda index: (kinds[index][0].name, *kinds[index][1:]))
        self._runs = _runs([kinds[index] for index in order])
        self.light_table = replace_table(self.device, LIGHT.pack([rows[i] for i in order]), self.light_table)

    def _faces(self, light: Light, boxes: np.ndarray, source: np.ndarray | None) -> tuple[Face, ...]:
        if not light.casts_shadow:
            return ()
        if source is not None:
            return light_faces(light, boxes, source)
        if light.key not in self._faces_of_still_lights:
            overlap = FILTER_OVERLAP if has_size(light) else 1.0
            self._faces_of_still_lights[light.key] = light_faces(light, boxes, overlap=overlap)
        return self._faces_of_still_lights[light.key]

    def _draw_shadows(self, gpu_scene: GpuScene) -> Iterator[float]:
        stale = self.maps.stale(gpu_scene)
        for done, tile in enumerate(stale):
            target, viewport = self.maps.begin(tile, gpu_scene)
            draws = visible_draws(gpu_scene, Visibility.SHADOW, tile.face.sees)
            draw_scene(
                self.device,
                gpu_scene,
                SHADOW,
                target,
                draws,
                viewport=viewport,
                pc_clip_from_world=tile.face.clip_from_world,
                pc_perspective=int(tile.face.perspective),
                pc_far=tile.face.far,
                pc_tile=float(viewport[2]),
            )
            yield (done + 1) / len(stale)

    def _shade(self, inputs: FrameInputs, target: Target, run: _Run, glossy: bool) -> None:
        extra = {"specular_tx": inputs.gbuffer.specular, "pc_eye": inputs.eye} if glossy else {}
        self.device.fullscreen(
            DIRECT[*run.kind, glossy],
            target,
            state=ADD if run.first else DrawState(),  # the first covers what was there
            position_tx=inputs.gbuffer.position,
            normal_tx=inputs.gbuffer.normal,
            light_tx=self.light_table,
            face_tx=self.maps.face_table,
            shadow_depth_tx=self.maps.depth,
            shadow_slope_tx=self.maps.colors[0],
            pc_first_light=run.first,
            pc_last_light=run.last,
            pc_seed=inputs.noise_seed(0),
            pc_sample=inputs.sample,
            **extra,
        )


def _runs(kinds: Sequence[tuple[LightKind, bool, bool]]) -> tuple[_Run, ...]:
    """The passes over a table of lights of these kinds: equal neighbours together, at most LIGHTS_A_PASS."""
    runs, first = [], 0
    while first < len(kinds):
        last = first + 1
        while last < min(len(kinds), first + LIGHTS_A_PASS) and kinds[last] == kinds[first]:
            last += 1
        runs.append(_Run(kinds[first], first, last))
        first = last
    return tuple(runs)


def _offset(seed: int, light: int) -> np.ndarray:
    """Where the light's sequence of emitter points begins: its own for every light, and always the same."""
    return np.random.default_rng((seed, light)).random(3)
