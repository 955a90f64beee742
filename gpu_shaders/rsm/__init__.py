"""Reflective shadow maps: one diffuse bounce gathered from what the lights see.

C. Dachsbacher and M. Stamminger, "Reflective Shadow Maps", I3D 2005.

1. Draw the scene from every light: position, normal and reflected flux (``frame.reflective_maps``).
2. Gather irradiance at every pixel from the texels, each a small Lambertian lamp: from all of them, from
   the paper's disc around the pixel's own place in the map as published, or from that disc with exact weights.
3. Screen-space interpolation (section 4.2 of the paper): gather on a coarse grid of pixels, reuse where plane and
   normal agree, gather in full where they do not.
4. Add the world's light (``frame.environment_light``), which the paper does not know.

Limits: no visibility between texel and pixel, so bounced light passes walls; diffuse reflectors only; one bounce;
cost grows with every light.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ...device.interface import Device, Target, Texture
from ...device.shader import Shader
from ..frame.coarse_grid import STRIDES, grid_offset, grid_size
from ..frame.draws import ADD
from ..frame.environment_light import EnvironmentLight
from ..frame.inputs import FrameInputs, LightTargets
from ..frame.map_views import draw_maps, map_views
from ..frame.maps import Atlas
from ..frame.reflective_maps import ReflectiveShadowMaps
from ..technique import DebugView, Item, Setting, Value
from .shaders import GATHER_ALL, GATHER_EXACT, GATHER_PUBLISHED, INTERPOLATE, SHADERS, VIEW_RESOLUTION

# Texel lookups in one pass: about half a second on one or two CPU cores, some milliseconds on a GPU.
WORK_SOFTWARE, WORK_HARDWARE = 1 << 26, 1 << 31
# Lookups of one pixel in one pass: Mesa's software renderer ends all loops of a shader after 65535 rounds, in silence.
LONGEST_LOOP = 1 << 15
# How far a sample is after maps and coarse grid, for the progress bar.
WORLD_DONE, MAPS_DONE, COARSE_DONE = 0.1, 0.2, 0.6
Passes = Iterator[tuple[Shader, Mapping[str, Any], float]]  # shader, its constants, progress
# However many lights there are, each gives at least this many: two from the disc, two from the whole map.
LEAST_GATHERS_A_LIGHT = 4

SETTINGS = (
    Setting(
        "estimator",
        "ENUM",
        "Estimator",
        "How bounced light is summed from the texels of the maps",
        "DISC_EXACT",
        items=(
            Item(
                "DISC_EXACT",
                "Disc, Exact Weight",
                "Random texels, more of them near the pixel's own place in the map, "
                "each weighted exactly: noise that averages out over samples, and no error in level",
            ),
            Item(
                "DISC_PUBLISHED",
                "Disc, as Published",
                "The disc of the 2005 paper with its weights: for comparison. It "
                "loses near light and all light from beyond the disc, where it ends with hard edges",
            ),
            Item(
                "ALL_TEXELS",
                "All Texels",
                "Every texel of every map: no noise at all, at the cost of hundreds of times the time",
            ),
        ),
    ),
    Setting(
        "resolution",
        "INT",
        "Map Resolution",
        "Texels along a side of each light's map. Higher keeps small and touching surfaces apart, at the cost of "
        "memory and of time where all texels are gathered; lower is faster and blurs bounce close to corners",
        256,
        viewport_default=128,
        minimum=32,
        maximum=2048,
        unit="texels",
        panel="Maps",
    ),
    Setting(
        "gathers",
        "INT",
        "Gathers",
        "Texels that each pixel gathers in one sample, shared among the lights, for the disc estimators. More is less "
        "noise a sample, at the cost of time",
        64,
        viewport_default=32,
        minimum=1,
        maximum=4096,
        unit="texels",
        panel="Maps",
    ),
    Setting(
        "radius",
        "FLOAT",
        "Disc Radius",
        "Radius of the disc of texels, in parts of the map's width. As published, light from beyond it is lost, so "
        "larger is brighter and noisier; with exact weights it changes the noise only, and smaller is better where "
        "near surfaces bounce most",
        0.3,
        minimum=0.01,
        maximum=1.5,
        unit="map widths",
        panel="Maps",
    ),
    Setting(
        "interpolation",
        "ENUM",
        "Interpolation",
        "Gather at some pixels only and reuse the result where surfaces agree. Coarser is faster, at the cost of "
        "detail in the bounce on small and curved surfaces",
        "OFF",
        viewport_default="QUARTER",
        items=(
            Item("OFF", "Off", "Every pixel gathers for itself"),
            Item("HALF", "1:2", "Every second pixel of every second row gathers"),
            Item("QUARTER", "1:4", "Every fourth pixel of every fourth row gathers"),
            Item("EIGHTH", "1:8", "Every eighth pixel of every eighth row gathers"),
        ),
    ),
)
VIEWS = (
    DebugView(
        "RSM_RESOLUTION",
        "Bounce Resolution",
        "Red: pixels that gathered for themselves. Green: those that took their bounced light from pixels around them",
    ),
    *map_views("RSM"),
)


class Rsm:
    """See the module."""

    id = "rsm"
    label = "Reflective Shadow Maps"
    description = "One diffuse bounce from what each light sees; off-screen light included, no occlusion of the bounce"
    settings = SETTINGS
    shaders = SHADERS
    views = VIEWS
    provisional = False

    def __init__(self, device: Device) -> None:
        self.device = device
        self.maps = ReflectiveShadowMaps(device)
        self._world = EnvironmentLight(device)
        self._none = device.texture((1, 1), "R32F")
        self._coarse: tuple[Texture, Target] | None = None
        self._reuse: tuple[Texture, Target] | None = None  # of the target that is interpolated into

    def indirect(self, inputs: FrameInputs, settings: Mapping[str, Value], targets: LightTargets) -> Iterator[float]:
        """One diffuse bounce, and the world's light; see ``Technique.indirect``."""
        target = targets.diffuse_indirect
        targets.clear_indirect(self.device, glossy=inputs.gpu_scene.is_glossy)
        for done in self._world.draw(inputs, targets):
            yield WORLD_DONE * done
        inputs.mark("world")
        for done in self.maps.update(inputs.gpu_scene, int(settings["resolution"])):
            yield WORLD_DONE + (MAPS_DONE - WORLD_DONE) * done
        inputs.mark("light maps")
        if not self.maps.tiles:
            return
        if settings["interpolation"] == "OFF":
            for done in self._gather(inputs, settings, target, self._none, 1, (0, 0)):
                yield MAPS_DONE + (1.0 - MAPS_DONE) * done
            inputs.mark("gather")
            return
        stride = STRIDES[str(settings["interpolation"])]
        offset = grid_offset(inputs.seed, inputs.sample, stride)
        coarse, coarse_target = self._coarse_target(inputs, stride)
        self.device.clear(coarse_target)
        for done in self._gather(inputs, settings, coarse_target, self._none, stride, offset):
            yield MAPS_DONE + (COARSE_DONE - MAPS_DONE) * done
        reused = self._interpolate(inputs, coarse, target, stride, offset)
        for done in self._gather(inputs, settings, target, reused, 1, (0, 0)):
            yield COARSE_DONE + (1.0 - COARSE_DONE) * done
        inputs.mark("gather")

    def view(
        self, key: str, inputs: FrameInputs, settings: Mapping[str, Value], target: Target, light: int = 0
    ) -> None:
        """See ``Technique.view``."""
        if not inputs.gpu_scene.scene.lights:
            return
        if key == "RSM_RESOLUTION":
            interpolates = settings["interpolation"] != "OFF" and self._reuse is not None
            self.device.fullscreen(
                VIEW_RESOLUTION,
                target,
                position_tx=inputs.gbuffer.position,
                reused_tx=self._reuse[0] if interpolates and self._reuse else self._none,
                pc_interpolates=int(interpolates),
            )
            return
        draw_maps(self.device, key, self.maps, inputs.gpu_scene, light, target)

    def statistics(self) -> Mapping[str, float]:
        atlas = self.maps.atlas
        tile = atlas.tile if atlas else 0
        return {
            "light_maps": len(self.maps.tiles),
            "light_maps_drawn": self.maps.drawn,
            "light_map_resolution": tile,
            "light_texels": len(self.maps.tiles) * tile * tile,
        }

    def free(self) -> None:
        self.maps.free()
        self._world.free()
        for resource in (self._none, *(self._coarse or ()), *(self._reuse or ())):
            self.device.free(resource)
        self._coarse = self._reuse = None

    def _gather(
        self,
        inputs: FrameInputs,
        settings: Mapping[str, Value],
        target: Target,
        reused: Texture,
        stride: int,
        offset: tuple[int, int],
    ) -> Iterator[float]:
        """Add the chosen estimator's sum to ``target``, in passes of bounded work."""
        positions, normals, fluxes = self.maps.colors[:3]
        shared: dict[str, Any] = {
            "position_tx": inputs.gbuffer.position,
            "normal_tx": inputs.gbuffer.normal,
            "reused_tx": reused,
            "rsm_position_tx": positions,
            "rsm_normal_tx": normals,
            "rsm_flux_tx": fluxes,
            "pc_stride": stride,
            "pc_offset": offset,
        }
        assert self.maps.atlas is not None
        passes = self._all_passes if settings["estimator"] == "ALL_TEXELS" else self._disc_passes
        work = WORK_SOFTWARE if self.device.is_software else WORK_HARDWARE
        pixels = target.size[0] * target.size[1]
        texels = min(max(work // pixels, 1), LONGEST_LOOP)
        for shader, values, done in passes(self.maps.atlas, inputs, settings, texels):
            self.device.fullscreen(shader, target, state=ADD, **shared, **values)
            yield done

    def _all_passes(self, atlas: Atlas, inputs: FrameInputs, settings: Mapping[str, Value], texels: int) -> Passes:
        """(shader, its constants, progress) for pieces of about ``texels`` texels."""
        width, height = atlas.size
        rows = max(texels // width, 1)
        for first in range(0, height, rows):
            last = min(first + rows, height)
            yield GATHER_ALL, {"pc_first_row": first, "pc_last_row": last, "pc_row_length": width}, last / height

    def _disc_passes(self, atlas: Atlas, inputs: FrameInputs, settings: Mapping[str, Value], texels: int) -> Passes:
        """The same for about ``texels`` gathers a pixel."""
        published = settings["estimator"] == "DISC_PUBLISHED"
        lights = sum(light.bounce > 0.0 for light in inputs.gpu_scene.scene.lights)  # the table has no others
        gathers = max(int(settings["gathers"]) // lights, LEAST_GATHERS_A_LIGHT)
        shared = {
            "light_tx": self.maps.light_table,
            "rsm_face_tx": self.maps.face_table,
            "pc_gathers": gathers,
            "pc_radius": float(settings["radius"]),
            "pc_seed": inputs.noise_seed(1),
            "pc_sample": inputs.sample,
        }
        # Whole lights while they fit, else a part of one light's gathers.
        step, part = max(texels // gathers, 1), min(gathers, texels)
        for first in range(0, lights, step):
            last = min(first + step, lights)
            for begin in range(0, gathers, part):
                span = {"pc_first_light": first, "pc_last_light": last}
                span |= {"pc_first_gather": begin, "pc_last_gather": min(begin + part, gathers)}
                yield GATHER_PUBLISHED if published else GATHER_EXACT, {**shared, **span}, last / lights

    def _interpolate(
        self, inputs: FrameInputs, coarse: Texture, target: Target, stride: int, offset: tuple[int, int]
    ) -> Texture:
        """Fill what can be reused into ``target``; returns the texture that tells which pixels were."""
        if self._reuse is None or self._reuse[1].colors[0] is not target.colors[0]:
            for old in self._reuse or ():
                self.device.free(old)
            reused = self.device.texture(target.size, "R32F")
            self._reuse = (reused, self.device.target([target.colors[0], reused]))
        reused, both = self._reuse
        self.device.fullscreen(
            INTERPOLATE,
            both,
            position_tx=inputs.gbuffer.position,
            normal_tx=inputs.gbuffer.normal,
            coarse_tx=coarse,
            pc_stride=stride,
            pc_offset=offset,
        )
        return reused

    def _coarse_target(self, inputs: FrameInputs, stride: int) -> tuple[Texture, Target]:
        size = grid_size(inputs.view, stride)
        if self._coarse is None or self._coarse[0].size[:2] != size:
            for old in self._coarse or ():
                self.device.free(old)
            texture = self.device.texture(size, "RGBA32F")
            self._coarse = (texture, self.device.target([texture]))
        return self._coarse
