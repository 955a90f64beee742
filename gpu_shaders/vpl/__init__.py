"""Virtual point lights, resampled: one bounce and more of all lights, with visibility, at a cost that knows no lights.

A. Keller, "Instant Radiosity", SIGGRAPH 1997; B. Bitterli et al., "Spatiotemporal reservoir resampling for real-time ray
tracing with dynamic direct lighting", SIGGRAPH 2020.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ...device.interface import Device, Target, Texture
from ..frame.draws import ADD
from ..frame.inputs import FrameInputs, LightTargets
from ..frame.voxels import Voxels
from ..technique import Item, Setting, Value
from .pool import Pool
from .shaders import GATHER, SHADERS, UPSAMPLE
from .sources import SKY_PATCHES, Sources

# How far a sample is after each step, for the progress bar.
MAPS_DONE, VOXELS_DONE, POOL_DONE, GATHER_DONE = 0.2, 0.4, 0.45, 0.9
STRIDES = {"FULL": 1, "HALF": 2, "QUARTER": 4, "EIGHTH": 8}

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
        "occlusion",
        "BOOL",
        "Occlusion",
        "Bounced light is blocked by what lies in between. Off shows what that changes: light passes walls",
        True,
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
        self._coarse: tuple[Texture, Texture, Target] | None = None
        self._both: tuple[Target, Target] | None = None

    def indirect(self, inputs: FrameInputs, settings: Mapping[str, Value], targets: LightTargets) -> Iterator[float]:
        """See ``Technique.indirect``."""
        gpu_scene = inputs.gpu_scene
        for done in self.sources.update_all(gpu_scene, int(settings["resolution"]), with_cache=False):
            yield MAPS_DONE * done
        if not self.sources.tiles:
            return
        for done in self.voxels.update(gpu_scene, int(settings["voxels"])):
            yield MAPS_DONE + (VOXELS_DONE - MAPS_DONE) * done
        self.pool.draw(self.sources, int(settings["pool"]), inputs.noise_seed(1) + 16 * inputs.sample)
        yield POOL_DONE
        stride = STRIDES[str(settings["scale"])]
        offset = _grid_offset(inputs, stride)
        indirect, direct, target = self._coarse_target(inputs, stride)
        self.device.fullscreen(
            GATHER,
            target,
            position_tx=inputs.gbuffer.position,
            normal_tx=inputs.gbuffer.normal,
            **self._candidate_bindings(inputs, settings),
            pc_candidates=int(settings["candidates"]),
            pc_occluded=int(settings["occlusion"]),
            pc_stride=stride,
            pc_offset=offset,
        )
        yield GATHER_DONE
        for source, full in ((indirect, targets.diffuse_indirect), (direct, targets.diffuse_direct)):
            self.device.fullscreen(
                UPSAMPLE,
                full,
                state=ADD,
                position_tx=inputs.gbuffer.position,
                normal_tx=inputs.gbuffer.normal,
                coarse_tx=source,
                pc_stride=stride,
                pc_offset=offset,
            )

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
        for resource in self._coarse or ():
            self.device.free(resource)
        self._coarse = None

    def _candidate_bindings(self, inputs: FrameInputs, settings: Mapping[str, Value]) -> dict[str, Any]:
        """What vpl_candidates_lib.glsl reads."""
        positions, normals, fluxes, _ = self.sources.colors
        sky = self.sources.tile_of(SKY_PATCHES)
        return {
            "position_area_tx": positions,
            "normal_kind_tx": normals,
            "flux_tx": fluxes,
            "tile_tx": self.sources.tile_table,
            "light_tx": self.sources.light_table,
            "face_tx": self.sources.face_table,
            **self.pool.bindings(),
            **self.voxels.bindings(),
            "pc_sky": self.sources.viewport(sky) if sky else (0, 0, 0, 0),
            "pc_sample": inputs.sample,
            "pc_seed": inputs.noise_seed(2),
            "pc_pool": int(settings["pool"]),
            "pc_tiles": len(self.sources.tiles),
            "pc_light_tiles": self.sources.light_tiles,
        }

    def _coarse_target(self, inputs: FrameInputs, stride: int) -> tuple[Texture, Texture, Target]:
        size = (-(-inputs.view.width // stride), -(-inputs.view.height // stride))
        if self._coarse is None or self._coarse[0].size[:2] != size:
            for old in self._coarse or ():
                self.device.free(old)
            textures = self.device.texture(size, "RGBA32F"), self.device.texture(size, "RGBA32F")
            self._coarse = (*textures, self.device.target(textures))
        return self._coarse


def _grid_offset(inputs: FrameInputs, stride: int) -> tuple[int, int]:
    """Where the coarse grid begins: another place every sample, so that its pattern averages out."""
    x, y = np.random.default_rng((inputs.seed, inputs.sample)).integers(0, stride, 2)
    return int(x), int(y)
