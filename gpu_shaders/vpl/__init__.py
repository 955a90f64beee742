"""Virtual point lights, resampled: one bounce and more of all lights, with visibility, at a cost that knows no lights.

A. Keller, "Instant Radiosity", SIGGRAPH 1997; B. Bitterli et al., "Spatiotemporal reservoir resampling for real-time ray
tracing with dynamic direct lighting", SIGGRAPH 2020.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ...device.interface import Device
from ..frame.inputs import FrameInputs, LightTargets
from ..frame.voxels import Voxels
from ..technique import Item, Setting, Value
from ..frame.reflective_shaders import SourceKind
from .cache import Cache
from .gather import Gathering, PoolState
from .index import PointIndex
from .pool import Pool
from .shaders import SHADERS
from .structs import VPL_FRAME
from .sources import CACHE, EMITTERS, POINTS_SIDE, SKY_PATCHES, Sources

# How far a sample is after each step, for the progress bar.
MAPS_DONE, VOXELS_DONE, CACHE_DONE = 0.2, 0.4, 0.6
# Updates of the cache before the first picture, each of which takes light a bounce further.
WARM_UP = 12
# Where light goes on, so many updates of a point after a change are forgotten at once, for they lack light of further
# bounces; then its mean is of this newer part of them.
FORGOTTEN, NEWER = 4, 0.5
ALL_KINDS = sum(1 << kind for kind in SourceKind)
FIRST_HAND = 1 << SourceKind.EMISSION | 1 << SourceKind.SKY  # light of which the cache's points send the first bounce

SETTINGS = (
    Setting(
        "scale",
        "ENUM",
        "Resolution",
        "Pixels that gather bounced light for themselves; the others take it from those around that lie on the same "
        "surface. Coarser is faster, at the cost of detail in the bounce on small and curved things",
        "HALF",
        viewport_default="QUARTER",
        items=(
            Item("FULL", "1:1", "Every pixel"),
            Item("HALF", "1:2", "Every second pixel of every second row"),
            Item("QUARTER", "1:4", "Every fourth pixel of every fourth row"),
            Item("EIGHTH", "1:8", "Every eighth pixel of every eighth row"),
        ),
    ),
    Setting(
        "resolution",
        "INT",
        "Map Resolution",
        "Texels along a side of each light's map. Higher keeps small and touching surfaces apart, at the cost of "
        "memory and of time when lights or objects move",
        256,
        viewport_default=256,
        minimum=64,
        maximum=2048,
        unit="texels",
    ),
    Setting(
        "pool",
        "INT",
        "Virtual Lights",
        "Virtual point lights chosen from all sources for each sample. More is less alike noise in neighbouring "
        "pixels, at the cost of time that does not depend on the picture's size",
        8192,
        viewport_default=4096,
        minimum=64,
        maximum=262144,
        unit="lights",
    ),
    Setting(
        "candidates",
        "INT",
        "Candidates",
        "Virtual lights that a pixel looks at in one sample before it traces a ray to one of them. More is less noise "
        "a sample, at the cost of time",
        16,
        viewport_default=8,
        minimum=1,
        maximum=1024,
        unit="lights",
    ),
    Setting(
        "bounces",
        "ENUM",
        "Bounces",
        "How often light is reflected before it reaches what the camera sees",
        "ONE",
        items=(
            Item("ONE", "1", "Light that was reflected once: quickest, and darker than life in closed rooms"),
            Item("MANY", "Many", "Light goes on until nothing is left of it, at the cost of time"),
        ),
    ),
    Setting(
        "cache_rows",
        "INT",
        "Cache Updates",
        "How many 64ths of the points that hold light for further bounces gather in each sample. More follows changes "
        "sooner and is calmer, at the cost of time",
        64,
        viewport_default=4,
        minimum=1,
        maximum=64,
        unit="rows of 64 points",
    ),
    Setting(
        "voxels",
        "INT",
        "Voxels",
        "Voxels along the longest side of the scene, through which rays test what is hidden. More keeps thin gaps and "
        "contacts open, at the cost of memory and of time when objects move",
        512,
        viewport_default=256,
        minimum=64,
        maximum=1024,
        unit="voxels",
    ),
    Setting(
        "reuse",
        "BOOL",
        "Reuse",
        "Keep what the picture before has found, where it shows the same surfaces. On is calm from the first pictures of a "
        "moving view, and light lags behind by some pictures; off knows nothing of other pictures",
        False,
        viewport_default=True,
    ),
    Setting(
        "denoise",
        "BOOL",
        "Denoise",
        "Smooth the bounced light of neighbouring pixels of one surface as far as its noise goes. On is clean at once; "
        "off keeps the noise, and the finest detail",
        False,
        viewport_default=True,
    ),
    Setting(
        "bound",
        "BOOL",
        "Bound",
        "Take a virtual light for a disc of the size that it stands for. Off takes it for a point: contacts are a "
        "little brighter, and much noisier",
        True,
    ),
    Setting(
        "lobe",
        "FLOAT",
        "Least Roughness of Bounces",
        "Glossy surfaces send light on as if they were at least this rough. Lower is truer to caustics, and noisier; "
        "higher spreads them",
        0.25,
        minimum=0.0,
        maximum=1.0,
    ),
    Setting(
        "occlusion",
        "ENUM",
        "Occlusion",
        "What blocks bounced light",
        "CONTACTS",
        items=(
            Item("NONE", "Nothing", "Light passes walls: to see what occlusion changes"),
            Item("VOXELS", "Voxels", "All of the scene, as coarse as its voxels"),
            Item(
                "CONTACTS",
                "Voxels and Contacts",
                "All of the scene, and what the camera sees closer than the voxels can tell, at the cost of some time",
            ),
        ),
    ),
)


class Vpl:
    """See the module."""

    id = "vpl"
    label = "Virtual Point Lights"
    description = "Bounced light of all lights, emissive surfaces and the sky, with occlusion, from one resampled pool"
    settings = SETTINGS
    shaders = SHADERS

    def __init__(self, device: Device) -> None:
        self.device = device
        self.sources = Sources(device)
        self.voxels = Voxels(device)
        self.pool = Pool(device)
        self.cache = Cache(device)
        self._indices = {CACHE: PointIndex(device), EMITTERS: PointIndex(device)}
        self._sorted = -1  # revision of the sources that the indices were made for
        self.gathering = Gathering(device)
        self._picture = 0  # number of the sample in its sequence of noise
        self._cache_updates = 0.0  # of every point since the scene changed
        self._cache_revision = -1  # of the scene that the cache last gathered in

    def indirect(self, inputs: FrameInputs, settings: Mapping[str, Value], targets: LightTargets) -> Iterator[float]:
        """See ``Technique.indirect``."""
        gpu_scene = inputs.gpu_scene
        # Noise goes on from picture to picture where they are averaged, else every picture has the same.
        self._picture = self._picture + 1 if settings["reuse"] else inputs.sample
        for done in self.sources.update_all(gpu_scene, int(settings["resolution"]), with_cache=self._wants_cache(inputs, settings)):
            yield MAPS_DONE * done
        if not self.sources.tiles:
            return
        for done in self.voxels.update(gpu_scene, int(settings["voxels"])):
            yield MAPS_DONE + (VOXELS_DONE - MAPS_DONE) * done
        for done in self._fill_pool(inputs, settings):
            yield VOXELS_DONE + (CACHE_DONE - VOXELS_DONE) * done
        candidates = self._candidates(inputs, settings, kinds=ALL_KINDS, number=self._picture)
        about = PoolState(self._picture, self.sources.revision)
        for done in self.gathering.draw(inputs, settings, candidates, about, targets):
            yield CACHE_DONE + (1.0 - CACHE_DONE) * done

    def _wants_cache(self, inputs: FrameInputs, settings: Mapping[str, Value]) -> bool:
        """Whether some light's first or further bounces come from the cache."""
        scene = inputs.gpu_scene.scene
        emits = any(any(material.emission) for material in scene.materials)
        return settings["bounces"] == "MANY" or emits or any(scene.world.color)

    def _fill_pool(self, inputs: FrameInputs, settings: Mapping[str, Value]) -> Iterator[float]:
        """Choose this sample's virtual lights; the cache gathers and sends anew. Yields progress."""
        count, seed = int(settings["pool"]), inputs.noise_seed(1) + 64 * self._picture
        if self._sorted != self.sources.revision:
            self._sort_points()
            self._sorted = self.sources.revision
        tile = self.sources.tile_of(CACHE)
        if tile is None:
            self.pool.draw(self.sources, count, seed)
            return
        many = settings["bounces"] == "MANY"
        rounds, rows = 1, int(settings["cache_rows"])
        if self._cache_revision < 0:
            rounds, rows = (WARM_UP if many else 1), POINTS_SIDE
        if self._cache_revision != inputs.gpu_scene.revision:
            self._cache_revision = inputs.gpu_scene.revision
            self._cache_updates = float(FORGOTTEN - rounds) if many else 0.0
        for number in range(rounds):
            self.cache.emit(self.sources, tile)
            self.pool.draw(self.sources, count, seed + number)
            candidates = self._candidates(
                inputs,
                settings,
                kinds=ALL_KINDS if many else FIRST_HAND,
                number=WARM_UP * self._picture + number,
            )
            counting = max(self._cache_updates - FORGOTTEN, 0.0) * NEWER if many else self._cache_updates
            self.cache.gather(self.sources, tile, candidates, rows, counting, inputs.gpu_scene.is_glossy)
            if self._cache_updates < 2 * FORGOTTEN:  # points come to light
                self.cache.emit(self.sources, tile)
                self._sort_points()
            self._cache_updates += rows / POINTS_SIDE
            yield (number + 1) / rounds

    def _sort_points(self) -> None:
        """Have the indices of surface points match the atlas."""
        assert self.voxels.grid is not None
        for owner, index in self._indices.items():
            tile = self.sources.tile_of(owner)
            if tile is not None:
                index.update(self.sources, tile, self.voxels.grid)

    def _points(self, owner: str) -> tuple[int, int, int]:
        """Where a kind of surface points lies in the atlas: lower left texel and side, 0 where there are none."""
        tile = self.sources.tile_of(owner)
        return self.sources.points_viewport(tile)[:3] if tile else (0, 0, 0)

    def statistics(self) -> Mapping[str, float]:
        atlas = self.sources.atlas
        return {
            "rsm_maps": self.sources.light_tiles,
            "rsm_maps_drawn": self.sources.drawn,
            "rsm_resolution": atlas.tile if atlas else 0,
            "vpls": len(self.sources.tiles) * atlas.tile**2 if atlas else 0,
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
            "index": self._indices[CACHE].place,
            "cache": self._points(CACHE),
            "pool": int(settings["pool"]),
            "emitters": self._points(EMITTERS),
            "tiles": len(self.sources.tiles),
            "light_tiles": self.sources.light_tiles,
            "candidates": int(settings["candidates"]),
            "occluded": int(settings["occlusion"] != "NONE"),
            "contact": int(settings["occlusion"] == "CONTACTS"),
            "bound": float(bool(settings["bound"])),
            "lobe": float(settings["lobe"]),
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
            **self.pool.bindings(),
            **self.voxels.bindings(),
            "vpl_frame": VPL_FRAME.pack([frame], for_uniform=True),
        }
