"""Virtual point lights, resampled: bounced light with visibility, at a cost that does not grow with the lights.

A. Keller, "Instant Radiosity", SIGGRAPH 1997; B. Bitterli et al., "Spatiotemporal reservoir resampling for real-time
ray tracing with dynamic direct lighting", SIGGRAPH 2020.

1. Draw what every lamp lights, and points of what emits, into one atlas of sources (``sources``).
2. Mark the voxels that the scene occupies (``frame.voxels``).
3. Choose a pool of virtual lights from the atlas in proportion to their strength (``pool``).
4. Points of the surfaces gather from the pool, for further bounces (``cache``, ``index``).
5. Some of the pixels gather: entries of the pool and a ray, one of them chosen and tested for visibility; reservoirs
   are reused over space and time, the result filtered and brought to all pixels (``gather``).
6. Glossy pixels follow one reflected ray; its light is averaged and filtered as the diffuse one is (``reflections``).

Limits: docs/vpl.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ...device.interface import Device, Target
from ..frame.inputs import FrameInputs, LightTargets
from ..frame.map_views import draw_maps
from ..frame.reflective_shaders import SourceKind
from ..frame.voxels import Voxels
from ..technique import Value
from .cache import MOST_WARM_UP, Cache
from .gather import Gathering, PoolState
from .index import PointIndex
from .pool import Pool
from .settings import SETTINGS
from .shaders import SHADERS
from .sources import CACHE, EMITTERS, SKY_PATCHES, Sources
from .structs import VPL_FRAME
from .views import VIEWS, view_occlusion, view_pool, view_voxels

if TYPE_CHECKING:
    from ...gpu_scene import GpuScene

# How far a sample is after each step, for the progress bar.
MAPS_DONE, VOXELS_DONE, CACHE_DONE = 0.2, 0.4, 0.6
ALL_KINDS = sum(1 << kind for kind in SourceKind)
FIRST_HAND = 1 << SourceKind.EMISSION | 1 << SourceKind.SKY  # light of which the cache's points send the first bounce


class Vpl:
    """See the module."""

    id = "vpl"
    label = "Virtual Point Lights"
    description = "Bounced light of all lights, emissive surfaces and the sky, with occlusion, from one resampled pool"
    settings = SETTINGS
    shaders = SHADERS
    views = VIEWS

    def __init__(self, device: Device) -> None:
        self.device = device
        self.sources = Sources(device)
        self.voxels = Voxels(device)
        self.pool = Pool(device)
        self.cache = Cache(device)
        self._indices = {CACHE: PointIndex(device), EMITTERS: PointIndex(device, covers=True)}
        self._sorted: dict[str, tuple[int, int]] = {}  # how often points were drawn and voxels built for each index
        self.gathering = Gathering(device)
        self._settings: Mapping[str, Value] = {}  # of the last sample
        self._picture = 0  # number of the sample in its sequence of noise

    def indirect(self, inputs: FrameInputs, settings: Mapping[str, Value], targets: LightTargets) -> Iterator[float]:
        """See ``Technique.indirect``."""
        gpu_scene = inputs.gpu_scene
        if inputs.sample == 0 and not (inputs.follows and settings["reuse"] and settings == self._settings):
            self._forget()
        self._settings = settings
        # Noise goes on from picture to picture where they are averaged, else every picture has the same.
        self._picture = self._picture + 1 if settings["reuse"] else inputs.sample
        with_cache = settings["bounces"] == "MANY" or _has_first_hand(gpu_scene)
        most = int(settings["maps_at_once"]) if inputs.follows else 0
        for done in self.sources.update_all(gpu_scene, int(settings["resolution"]), with_cache, most):
            yield MAPS_DONE * done
        inputs.mark("light maps")
        if not self.sources.tiles:
            self.gathering.forget()  # or light of before the last lamp went would be waited for without end
            targets.clear_indirect(self.device, glossy=gpu_scene.is_glossy)
            return
        for done in self.voxels.update(gpu_scene, int(settings["voxels"])):
            yield MAPS_DONE + (VOXELS_DONE - MAPS_DONE) * done
        inputs.mark("voxels")
        for done in self._fill_pool(inputs, settings):
            yield VOXELS_DONE + (CACHE_DONE - VOXELS_DONE) * done
        inputs.mark("virtual lights")
        candidates = self._candidates(inputs, settings, kinds=ALL_KINDS, number=self._picture)
        settles = self.sources.tile_of(CACHE) is not None and self.cache.settles
        about = PoolState(self._picture, self.sources.revision, _has_first_hand(gpu_scene), settles)
        for done in self.gathering.draw(inputs, settings, candidates, about, targets):
            yield CACHE_DONE + (1.0 - CACHE_DONE) * done

    @property
    def provisional(self) -> bool:
        """See ``Technique.provisional``."""
        return self.sources.pending > 0 or self.gathering.provisional

    def view(
        self, key: str, inputs: FrameInputs, settings: Mapping[str, Value], target: Target, light: int = 0
    ) -> None:
        """See ``Technique.view``."""
        if not self.sources.tiles:
            return
        if key == "VPL_HISTORY":
            self.gathering.view_history(target)
        elif key == "VPL_RESOLUTION":
            self.gathering.view_resolution(inputs, target)
        elif key == "VPL_BOUND":
            candidates = self._candidates(inputs, settings, kinds=ALL_KINDS, number=self._picture)
            self.gathering.view_bound(inputs, candidates, target)
        elif key == "VPL_VOXELS":
            view_voxels(self.device, self.voxels, inputs, target)
        elif key == "VPL_OCCLUSION":
            view_occlusion(self.device, self.voxels, inputs, target)
        elif key == "VPL_POOL":
            view_pool(self.device, self.pool, int(settings["pool"]), len(self.sources.tiles), inputs, target)
        else:
            draw_maps(self.device, key, self.sources, inputs.gpu_scene, light, target)

    def _forget(self) -> None:
        """Begin a picture that knows nothing of those before it."""
        self._picture = 0
        self.cache.forget()
        self._sorted.pop(CACHE, None)  # nor do the points send anything
        self.gathering.forget()

    def _fill_pool(self, inputs: FrameInputs, settings: Mapping[str, Value]) -> Iterator[float]:
        """Choose this sample's virtual lights; the cache gathers and sends anew. Yields progress."""
        count, seed = int(settings["pool"]), inputs.noise_seed(1)
        tile = self.sources.tile_of(CACHE)
        for owner in self._indices:
            drawn = self.sources.points_drawn[owner], self.voxels.built
            if self._sorted.get(owner) != drawn:
                if tile is not None and owner == CACHE:
                    self.cache.emit(self.sources, tile)  # before they are sorted: points without light are left out
                self._sort_points(owner)
                self._sorted[owner] = drawn
        if tile is None:
            self.pool.draw(self.sources, count, MOST_WARM_UP * self._picture, seed)
            return
        many = settings["bounces"] == "MANY"
        rounds, rows = self.cache.plan(inputs.gpu_scene, many=many, rows=int(settings["cache_rows"]))
        kinds = ALL_KINDS if many else FIRST_HAND
        for number in range(rounds):
            update = MOST_WARM_UP * self._picture + number
            self.pool.draw(self.sources, count, update, seed)
            candidates = self._candidates(inputs, settings, kinds=kinds, number=update)
            have_light = self.cache.gather(self.sources, tile, candidates, rows, glossy=inputs.gpu_scene.is_glossy)
            # Always, as the sky's part of what points send is told from what they gathered.
            self.cache.emit(self.sources, tile)
            if have_light:
                self._sort_points(CACHE)
            yield (number + 1) / rounds

    def _sort_points(self, owner: str) -> None:
        """Have the index of one kind of surface points match the atlas."""
        tile = self.sources.tile_of(owner)
        if tile is not None:
            self._indices[owner].update(self.sources, tile, self.voxels.grids)

    def _points(self, owner: str) -> tuple[int, int, int]:
        """Where a kind of surface points lies in the atlas: lower left texel and side, 0 where there are none."""
        tile = self.sources.tile_of(owner)
        return self.sources.points_viewport(tile)[:3] if tile else (0, 0, 0)

    def statistics(self) -> Mapping[str, float]:
        atlas = self.sources.atlas
        return {
            "light_maps": self.sources.light_tiles,
            "light_maps_drawn": self.sources.drawn,
            "light_maps_pending": self.sources.pending,
            "light_map_resolution": atlas.tile if atlas else 0,
            "virtual_lights": int(self._settings["pool"]) if self.sources.tiles else 0,
            "light_texels": len(self.sources.tiles) * atlas.tile**2 if atlas else 0,
        }

    def free(self) -> None:
        self.sources.free()
        self.voxels.free()
        self.pool.free()
        self.cache.free()
        for index in self._indices.values():
            index.free()
        self.gathering.free()

    def _candidates(
        self, inputs: FrameInputs, settings: Mapping[str, Value], *, kinds: int, number: int
    ) -> dict[str, Any]:
        """What vpl_candidates_lib.glsl reads; ``number`` is the sample's in its sequence of noise."""
        positions, normals, fluxes, speculars = self.sources.colors
        sky = self.sources.tile_of(SKY_PATCHES)
        frame = {
            "clip_from_world": inputs.clip_from_world,
            "eye": inputs.eye,
            "sky": self.sources.viewport(sky) if sky else (0, 0, 0, 0),
            **self._indices[CACHE].cubes,
            "index_levels": len(self._indices[CACHE].places),
            "cache": self._points(CACHE),
            "pool": int(settings["pool"]),
            "emitters": self._points(EMITTERS),
            "tiles": len(self.sources.tiles),
            "emitter_tile": self.sources.index_of(EMITTERS),
            "sky_tile": self.sources.index_of(SKY_PATCHES),
            "light_tiles": self.sources.light_tiles,
            "candidates": int(settings["candidates"]),
            "occluded": int(settings["occlusion"] != "NONE"),
            "contact": int(settings["occlusion"] == "CONTACTS"),
            "bound": float(bool(settings["bound"])),
            "lobe": float(settings["lobe"]),
            "mirrored": int(inputs.gpu_scene.environment.mirrored),
            "kinds": kinds,
            "number": number,
            "seed": inputs.noise_seed(2),
        }
        return {
            "position_tx": inputs.gbuffer.position,
            "position_area_tx": positions,
            "normal_kind_tx": normals,
            "flux_tx": fluxes,
            "specular_tx": speculars,
            "tile_tx": self.sources.tile_table,
            "light_tx": self.sources.light_table,
            "face_tx": self.sources.face_table,
            "cache_index_tx": self._indices[CACHE].texture,
            "emitter_index_tx": self._indices[EMITTERS].texture,
            "cache_sky_tx": self.cache.sky,
            **self.pool.bindings(),
            **self.voxels.bindings(),
            "vpl_frame": VPL_FRAME.pack([frame], for_uniform=True),
        }


def _has_first_hand(gpu_scene: GpuScene) -> bool:
    """Whether emitters or the sky give light: direct light from the pool, whose first bounce is the cache's."""
    return gpu_scene.emits or gpu_scene.environment.lights
